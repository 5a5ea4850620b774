"""Exceptions that several solvers of `fem_reference` raise."""


class ConvergenceError(RuntimeError):
    """An iterative solver stopped before it reached its tolerance."""
