"""Exceptions that several solvers of `fem_reference` raise."""


class ConvergenceError(RuntimeError):
    """An iterative solver stopped before it reached its tolerance."""


class TooShallowError(ConvergenceError):
    """Nothing touches on the grid of the contact, because the load or depth is too small for it."""
