"""Linear systems with the tangent: one interface, a file a method."""
