"""Errors that every solver of the package may raise."""


class ConvergenceError(RuntimeError):
    """A solver stopped before it reached its tolerance."""
