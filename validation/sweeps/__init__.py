"""Sweeps: many designs of a sensor, measured on one or many processors; a store of results is their only state."""
