"""Surfaces of triangles: reading STL files, convex hulls, and the gap between a body and a plane below it."""
