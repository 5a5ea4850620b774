"""Response of a linear cover to a unit load: base pressure, texel forces and surface displacement."""
