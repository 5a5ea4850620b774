"""Derivation of the fast model's parameters from a sensor file: finite-element response of the cover, then a fit."""
