"""Fits of the fast model's parameters to results of the reference."""
