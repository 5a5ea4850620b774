"""Conversion of contact forces to frames: low-pass filter, point spread, electronics."""
