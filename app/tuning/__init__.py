"""Homogeneous tests of materials, and what is fitted to them."""
