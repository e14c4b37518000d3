"""What a gmsh model holds, in plain arrays on rank 0: cells of one type, and the elements that have names."""
