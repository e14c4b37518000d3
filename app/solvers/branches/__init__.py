"""Branches of equilibria, stable or not."""
