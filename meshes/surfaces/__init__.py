"""Surfaces of triangles: reading STL files, the gap below a body, and the convex hulls that make up its underside."""
