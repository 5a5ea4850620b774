"""The contact methods by name, and the choice of the default one."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from types import MappingProxyType

from fastmodel.contact.area import AreaTexels
from fastmodel.contact.boxes import BoxTexels
from fastmodel.contact.cover import CoverContact, Foundation
from fastmodel.contact.interface import TexelContact
from fastmodel.curved.contact import CurvedContact
from fastmodel.errors import FastModelError, ParametersError, name_unknown
from fastmodel.parameters import Parameters

#: Contact methods with their default settings, by name.
METHODS: Mapping[str, TexelContact] = MappingProxyType(
    {"boxes": BoxTexels(), "area": AreaTexels(), "foundation": Foundation(), "cover": CoverContact()}
)
#: Name of the method for curved covers, whose settings are the cover itself.
CURVED = "curved"
#: Name that stands for the method `curved` or `cover` if the parameters hold its data, otherwise for `boxes`.
DEFAULT = "default"


def choose_method(method: str | TexelContact, parameters: Parameters) -> tuple[str, TexelContact]:
    """Find a contact method by its name, or return given settings unchanged.

    The name `default` stands for `curved` if the parameters hold a curved cover, for `cover` if they hold the cells of
    a flat one, otherwise for `boxes`.  The name `curved` takes the curved cover of the parameters.

    Args:
        method: Name of a contact method, or an object with its settings such as `BoxTexels()`.
        parameters: The array and its cover.

    Returns:
        The name of the method, or its settings as text if settings were given; and the settings.

    Raises:
        FastModelError: If the method is neither a name nor settings.
        FastModelError: If no contact method has this name.
        ParametersError: If the method is `curved` and the parameters hold no curved cover.
    """
    if not isinstance(method, str):
        if isinstance(method, type) or not (hasattr(method, "attach") and hasattr(method, "bind")):
            raise FastModelError(
                f"the contact method must be a name of fastmodel.METHODS or settings such as fastmodel.BoxTexels(), "
                f"not {method!r}"
            )
        return repr(method), method
    if method == CURVED or (method == DEFAULT and parameters.curved is not None):
        if parameters.curved is None:
            raise ParametersError(
                "the contact method 'curved' needs a curved cover, which these parameters do not hold"
            )
        return CURVED, CurvedContact(cover=parameters.curved)
    if method == DEFAULT:
        method = "boxes" if parameters.cells is None else "cover"
    if method not in METHODS:
        raise name_unknown("contact method", method, (DEFAULT, *METHODS, CURVED))
    return method, _end_plate_at_edges(METHODS[method], parameters)


def _end_plate_at_edges(method: TexelContact, parameters: Parameters) -> TexelContact:
    """Set the margin of a method's plate to zero if the cover has free side edges; else return the method unchanged."""
    if parameters.cells is None or parameters.cells.table is None or not isinstance(method, CoverContact | Foundation):
        return method
    return dataclasses.replace(method, plate=dataclasses.replace(method.plate, margin=0))
