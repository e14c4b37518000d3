"""Solvers of linear systems with the tangent."""
