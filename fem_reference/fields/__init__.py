"""Displacement and stress in a cover under an indenter."""
