"""Every shape by its name."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from meshes.indenters.flat_faces import LetterH, Nut
from meshes.indenters.indenter import Box, Cone, Cylinder, Roller, RoundedTip, Sphere

#: Shapes by the name that sensor files and the command line use.
SHAPES: Mapping[str, type[Any]] = MappingProxyType(
    {
        "sphere": Sphere,
        "cylinder": Cylinder,
        "box": Box,
        "tip": RoundedTip,
        "roller": Roller,
        "cone": Cone,
        "nut": Nut,
        "h": LetterH,
    }
)
