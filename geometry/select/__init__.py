"""Faces and regions that a mesh does not name: what is asked for, and what of the mesh that is."""
