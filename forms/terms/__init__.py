"""Π as a sum of named terms."""
