"""Finite elements: Taylor-Hood elements, their fast form on tensor meshes, and the grading of meshes."""
