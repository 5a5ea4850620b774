"""The contact methods by name, and the choice of the default one."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from fastmodel.contact.area import AreaTexels
from fastmodel.contact.boxes import BoxTexels
from fastmodel.contact.cover import CoverContact, Foundation
from fastmodel.contact.interface import TexelContact
from fastmodel.contact.mesh import MeshContact
from fastmodel.errors import FastModelError, name_unknown
from fastmodel.parameters import Parameters

#: Contact methods with their default settings, by name.
METHODS: Mapping[str, BoxTexels | AreaTexels | Foundation | CoverContact | MeshContact] = MappingProxyType(
    {
        "boxes": BoxTexels(),
        "area": AreaTexels(),
        "foundation": Foundation(),
        "cover": CoverContact(),
        "curved": MeshContact(),
    }
)
#: Name that stands for the method of the parameters' surface (`cover` or `curved`), without a surface for `boxes`.
DEFAULT = "default"


def choose_method(method: str | TexelContact, parameters: Parameters) -> tuple[str, TexelContact]:
    """Find a contact method by its name and adapt it to the cover, or return given settings unchanged.

    The name `default` stands for the method of the parameters' surface, without a surface for `boxes`.

    Args:
        method: Name of a contact method, or an object with its settings such as `BoxTexels()`.
        parameters: The array and its cover.

    Returns:
        The name of the method, or its settings as text if settings were given; and the settings.

    Raises:
        FastModelError: If the method is neither a name nor settings.
        FastModelError: If no contact method has this name, or it is for flat covers and the cover is curved.
        ParametersError: If the method needs another surface than the parameters hold.
    """
    if not isinstance(method, str):
        if isinstance(method, type) or not (hasattr(method, "attach") and hasattr(method, "bind")):
            raise FastModelError(
                f"the contact method must be a name of fastmodel.METHODS or settings such as fastmodel.BoxTexels(), "
                f"not {method!r}"
            )
        return repr(method), method
    if method == DEFAULT:
        method = "boxes" if parameters.surface is None else parameters.surface.method
    if method not in METHODS:
        raise name_unknown("contact method", method, (DEFAULT, *METHODS))
    if parameters.surface is not None and parameters.surface.method == "curved" != method:
        raise FastModelError(f"the contact method {method} is for flat covers, this one is curved; leave it out")
    return method, METHODS[method].adapt(parameters.surface)
