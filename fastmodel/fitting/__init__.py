"""Fits of the fast model's parameters to results of the finite-element reference."""
