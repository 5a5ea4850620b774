"""Finite elements: mixed Taylor-Hood elements, tensor-product meshes, and the scaling of units."""
