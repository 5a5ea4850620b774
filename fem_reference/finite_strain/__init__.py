"""Contact at finite strain: Newton's method along a loading path, axisymmetric and in three dimensions."""
