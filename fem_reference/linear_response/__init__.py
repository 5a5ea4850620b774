"""Response of a linear elastic cover to a unit load: base pressure, texel forces and displacement of the top.

`point_spread` and `surface_compliance` apply to laterally wide covers, `finite_cover` to covers of limited size.
"""
