"""Estimation of the conversion from force to counts of a real sensor, from recordings under known loads."""
