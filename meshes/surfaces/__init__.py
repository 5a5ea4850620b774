"""Surfaces of triangles: STL files, the gap between a body and a cover, and convex hulls of a body's underside."""
