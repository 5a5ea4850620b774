"""Fits of the fast model's parameters to a reference response."""
