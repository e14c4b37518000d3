"""Errors against run time."""
