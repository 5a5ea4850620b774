"""Cases, recordings, scores, reports and the command line."""

from importlib.metadata import version

__version__ = version("softcover")
