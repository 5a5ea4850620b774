"""Contact of a rigid indenter with a cover at finite strain, axisymmetric or three-dimensional, by Newton's method."""
