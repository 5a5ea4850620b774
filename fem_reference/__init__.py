"""The truth: finite-element solutions of a soft cover over a rigid texel array."""
