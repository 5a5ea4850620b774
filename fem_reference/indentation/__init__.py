"""Indentation of a cover by a rigid indenter; `press` selects the solver for cover, indenter and friction."""
