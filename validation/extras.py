"""Optional packages: the extra of softcover that installs each, and a check that a command's packages are installed."""

from __future__ import annotations

from collections.abc import Iterable
from importlib.util import find_spec

#: Modules of the optional packages, by name of the extra of softcover that installs them.
_MODULES = {
    "fem": ("skfem", "pymetis", "trimesh", "manifold3d"),
    "curved": ("pytetwild",),
    "report": ("jinja2", "matplotlib"),
    "device": ("serial", "mcap", "mcap_ros2", "rosbags"),
    "gym": ("gymnasium",),
    "view": ("pyvista",),
    "sweep": ("dask", "distributed", "xarray"),
}
#: Extra of the package (`pip install -e '.[EXTRA]'` in a clone) that installs each optional module.
EXTRAS = {module: extra for extra, modules in _MODULES.items() for module in modules}
#: Optional modules that a report needs.
REPORT_MODULES = ("jinja2", "matplotlib")


class MissingExtraError(ImportError):
    """Reports that optional packages are needed and not installed.

    Attributes:
        extras: Names of the optional dependency groups that install the packages.
    """

    def __init__(self, *modules: str, otherwise: str = "") -> None:
        """Make the message.

        Args:
            *modules: Names of the missing modules, keys of `EXTRAS`.
            otherwise: Alternative without these packages; empty if there is none.
        """
        self.extras = tuple(dict.fromkeys(EXTRAS[module] for module in modules))
        verb = "is" if len(modules) == 1 else "are"
        way_out = f"; or {otherwise}" if otherwise else ""
        super().__init__(
            f"{', '.join(modules)} {verb} not installed; "
            f"run in a clone of softcover: python -m pip install -e '.[{','.join(self.extras)}]'{way_out}"
        )


def require(*modules: str, useful: Iterable[str] = (), otherwise: str = "") -> None:
    """Check that all optional modules of a command are installed; to be called before long computations.

    Args:
        *modules: Names of the modules that the command needs, keys of `EXTRAS`.
        useful: Modules that the command can do without, for example for pictures.  The error also names missing modules
            of this kind, so that one installation suffices.
        otherwise: Alternative without these modules; empty if there is none.

    Raises:
        MissingExtraError: If a needed module is missing; it names all that are missing.
    """
    if any(_is_missing(module) for module in modules):
        raise MissingExtraError(*filter(_is_missing, (*modules, *useful)), otherwise=otherwise)


def _is_missing(module: str) -> bool:
    return find_spec(module) is None
