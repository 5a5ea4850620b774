"""Response of a linear cover to a unit load: base pressure, texel forces and surface displacement.

`point_spread` and `surface_compliance` answer for laterally wide covers, `finite_cover` for covers of limited size.
"""
