"""Cases, recordings, scores, reports and the command line; each function does in Python what a command does.

The functions are imported at their first use, so that `import validation` is fast.
"""

import lazy_loader

# The public names are those of `__init__.pyi`.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
