"""Finite elements: Taylor-Hood elements, their fast form on tensor meshes, the grading of meshes, and units."""
