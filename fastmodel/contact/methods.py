"""The contact methods by name, and which one is used when none is named."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from types import MappingProxyType

from fastmodel.contact.area import AreaTexels
from fastmodel.contact.boxes import BoxTexels, TexelContact
from fastmodel.contact.cover import CoverContact, Foundation
from fastmodel.errors import UnknownNameError
from fastmodel.parameters import Parameters

#: Contact methods by name.
METHODS: Mapping[str, TexelContact] = MappingProxyType(
    {"boxes": BoxTexels(), "area": AreaTexels(), "foundation": Foundation(), "cover": CoverContact()}
)
#: Name of the best method that the parameters allow.
DEFAULT = "default"


def choose(method: str | TexelContact, parameters: Parameters) -> tuple[str, TexelContact]:
    """A contact method by name, or the one given.

    `default` is `cover` where the parameters hold the cover's cells, and the boxes of the 2015 report elsewhere.

    Args:
        method: Name or settings.
        parameters: What it is for.

    Returns:
        Its name (settings as text) and itself.

    Raises:
        UnknownNameError: If there is none of that name.
    """
    if not isinstance(method, str):
        return repr(method), method
    if method == DEFAULT:
        method = _best(parameters)
    if method not in METHODS:
        raise UnknownNameError("contact method", method, (DEFAULT, *METHODS))
    return method, _within_sides(METHODS[method], parameters)


def _within_sides(method: TexelContact, parameters: Parameters) -> TexelContact:
    """The method with a plate that ends with the array where the cover has side edges."""
    if parameters.cells is None or parameters.cells.table is None or not isinstance(method, CoverContact | Foundation):
        return method
    return dataclasses.replace(method, plate=dataclasses.replace(method.plate, margin=0))


def _best(parameters: Parameters) -> str:
    return "boxes" if parameters.cells is None else "cover"
