"""Frictionless contact at small strain: cells on the compliance of the top surface."""
