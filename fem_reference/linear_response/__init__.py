"""Response of a linear cover to a unit load: base pressure, texel forces and surface displacement.

`point_spread` and `surface_compliance` treat laterally wide covers, `finite_cover` covers of limited size.
"""
