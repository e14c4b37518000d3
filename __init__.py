"""Tunes hyperelastic materials and proves the result by finite elements."""
