"""Independent truths: manufactured solutions, recomputed forces."""
