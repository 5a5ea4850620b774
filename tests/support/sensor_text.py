"""The text of a small sensor file."""

GOOD = """
[array]
rows = 3
columns = 2
pitch = "3.4 mm"

[[cover.layer]]
thickness = "2 mm"
material = { model = "linear-elastic", youngs_modulus = "1 MPa", poisson_ratio = 0.49 }

[electronics]
rate = "271 Hz"
sensitivity = "2665.7 1/N"
"""
