"""Every material through the scenes that break solvers."""
