"""Cases, recordings, scores, reports and the command line; each verb does in Python what a command does.

The verbs are imported when they are first used, so that `import validation` stays cheap.
"""

import lazy_loader

# The public names are those of `__init__.pyi`.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
