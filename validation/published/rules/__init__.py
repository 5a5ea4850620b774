"""The published models, one function per model.  Every module of this folder is imported and enters its models.

Equations and sources: docs/comparison-models.md.
"""

from importlib import import_module
from pkgutil import iter_modules

from validation.published.model import PUBLISHED

__all__ = ["PUBLISHED"]

for _module in iter_modules(__path__, f"{__name__}."):
    import_module(_module.name)
