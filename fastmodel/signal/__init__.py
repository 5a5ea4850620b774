"""From texel forces to frames: low-pass filter, point spread, electronics."""
