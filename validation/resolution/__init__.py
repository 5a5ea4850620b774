"""Limits of a sensor: the smallest errors of place, force, radius and separation, and the least detectable force."""
