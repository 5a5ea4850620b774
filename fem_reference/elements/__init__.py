"""Finite elements: Taylor-Hood elements, their fast assembly on tensor-product meshes, and the grading of meshes."""
