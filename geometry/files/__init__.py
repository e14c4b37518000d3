"""Files of meshes and bodies: each kind is brought into a gmsh model, with the groups that it means."""
