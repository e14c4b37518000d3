"""Scenes: what a person writes, checked and built into a body."""
