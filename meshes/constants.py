"""Physical constants."""

#: Standard gravity: the force on a mass of 1 kg [N/kg, m/s2].
STANDARD_GRAVITY = 9.80665
