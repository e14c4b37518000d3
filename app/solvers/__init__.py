"""From a state to one in balance: Newton's method, its linear solvers, and what keeps it on its way down."""
