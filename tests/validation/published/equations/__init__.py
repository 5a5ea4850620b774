"""The equations of the published models, written anew; every module of this folder holds some of the models.

`EQUATIONS` holds by name the equation of a model, the values of its parameters, and whether the forces on the texels
and the force outside add up to the load.
"""

from importlib import import_module
from pkgutil import iter_modules

from tests.validation.published.equations.table import EQUATIONS

__all__ = ["EQUATIONS"]

for _module in iter_modules(__path__, f"{__name__}."):
    import_module(_module.name)
