"""Arrays, covers and materials that can be named instead of described."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from meshes.array import TexelArray
from meshes.cover import Cover, Layer
from meshes.material import Material

_DATABASE = (
    "neo-Hookean fit up to 100 % strain to the raw curves of the Soft Robotics Materials Database "
    "(Marechal et al. 2020); crosshead strain, so biased low; datasheet moduli are 1.1..3.7 times larger"
)


def _silicone(name: str, shear_modulus: float, source: str = _DATABASE, spread: float = 0.5) -> Material:
    return Material(
        name=name,
        model="neo-hookean",
        parameters={"shear_modulus": shear_modulus},
        poisson_ratio=0.5,
        source=source,
        spread=spread,
    )


def _elastic(name: str, youngs_modulus: float, poisson_ratio: float, source: str, spread: float) -> Material:
    return Material(
        name=name,
        model="linear-elastic",
        parameters={"youngs_modulus": youngs_modulus},
        poisson_ratio=poisson_ratio,
        source=source,
        spread=spread,
    )


#: Named materials.
MATERIALS: Mapping[str, Material] = MappingProxyType(
    {
        material.name: material
        for material in (
            _silicone("ecoflex-00-10", 8.0e3),
            _silicone("ecoflex-00-30", 16.1e3),
            _silicone("ecoflex-00-50", 22.4e3),
            _silicone("dragon-skin-10", 56.4e3),
            _silicone("dragon-skin-20", 160e3),
            _silicone("dragon-skin-30", 223e3),
            _silicone("rtv615", 403e3),
            _elastic("natural-rubber-40", 1.5e6, 0.4997, "Lindley, IRHD 40", 0.15),
            _elastic("neoprene", 3e6, 0.495, "solid neoprene, 2..5 MPa, nu 0.49..0.499", 0.5),
            _elastic("neoprene-sponge", 0.3e6, 0.15, "neoprene sponge, 0.1..0.6 MPa, nu 0..0.3", 0.6),
            _elastic("silicone-foam", 0.1e6, 0.15, "silicone foam, 10..300 kPa, nu 0..0.3", 0.8),
            _elastic("polyurethane-foam", 0.1e6, 0.15, "polyurethane foam, 10..300 kPa, nu 0..0.3", 0.8),
        )
    }
)

#: Nobody published what covers a WTS 0614-34; 2 mm of nearly incompressible rubber is a guess.
ASSUMED_COVER = Cover(
    layers=(
        Layer(
            thickness=2e-3,
            material=_elastic("assumed elastomer", 1e6, 0.49, "assumed: nobody published it", 0.5),
        ),
    ),
    assumed=True,
)

_PITCH = 3.4e-3


def _sdh2_mask() -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """The array of an SDH-2 fingertip: in its first five rows the two outer columns are missing."""
    active = np.ones((13, 6), dtype=bool)
    active[:5, [0, 5]] = False
    return active


#: Named arrays: the Weiss WTS 0614-34 and the distal array of a SCHUNK SDH-2 finger.
ARRAYS: Mapping[str, TexelArray] = MappingProxyType(
    {
        "wts-0614-34": TexelArray.grid(14, 6, _PITCH, name="wts-0614-34"),
        "sdh2-distal": TexelArray.grid(13, 6, _PITCH, active=_sdh2_mask(), name="sdh2-distal"),
    }
)
