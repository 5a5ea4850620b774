"""Physical constants."""

#: Standard gravity: weight per unit mass, and the acceleration of a freely falling body [N/kg = m/s2].
STANDARD_GRAVITY = 9.80665
