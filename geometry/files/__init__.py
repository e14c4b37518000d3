"""Meshes from files: each kind is brought into a gmsh model, and what the model holds into plain arrays."""
