"""Arrays, covers and materials that can be named instead of described."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType

import numpy as np

from meshes.array import TexelArray
from meshes.cover import Cover, Layer
from meshes.material import Material

_DATABASE = (
    "{} to the raw curves of the Soft Robotics Materials Database (Marechal et al. 2020); "
    "crosshead strain, so biased low; datasheet moduli are 1.1..3.7 times larger"
)

#: Neo-Hookean mu [kPa]; Yeoh C1, C2, C3 [kPa]; one-term Ogden mu [kPa] and alpha [-].
_SILICONES: Mapping[str, tuple[float, tuple[float, float, float], tuple[float, float]]] = MappingProxyType(
    {
        "ecoflex-00-10": (8.0, (3.61, 0.138, -0.0002), (5.8, 2.91)),
        "ecoflex-00-30": (16.1, (7.83, 0.103, -0.0008), (14.4, 2.35)),
        "ecoflex-00-50": (22.4, (10.67, 0.261, -0.0033), (19.3, 2.52)),
        "dragon-skin-10": (56.4, (24.29, 2.250, -0.0543), (49.7, 2.86)),
        "dragon-skin-20": (160, (70.40, 5.223, -0.113), (136, 2.83)),
        "dragon-skin-30": (223, (100.6, 6.387, -0.149), (197, 2.72)),
        "rtv615": (403, (163.2, 13.86, 0.939), (224, 3.82)),
    }
)

#: Hardness [IRHD] -> Young's modulus [Pa] and Poisson ratio at a bulk modulus of 1 GPa, nu = 1/2 - E / 6 K [-].
_NATURAL_RUBBER: Mapping[int, tuple[float, float]] = MappingProxyType(
    {
        30: (0.92e6, 0.4998),
        40: (1.50e6, 0.4997),
        50: (2.20e6, 0.4996),
        60: (4.45e6, 0.4993),
        70: (7.35e6, 0.4988),
    }
)


def _silicones() -> Iterator[Material]:
    """Each silicone as neo-Hookean by its plain name, and its Yeoh and Ogden fits."""
    for name, (shear_modulus, yeoh, (mu, alpha)) in _SILICONES.items():
        yield _rubber(name, "neo-hookean", {"shear_modulus": shear_modulus * 1e3}, "neo-Hookean fit up to 100 % strain")
        coefficients = dict(zip(("c1", "c2", "c3"), (1e3 * c for c in yeoh), strict=True))
        yield _rubber(f"{name}-yeoh", "yeoh", coefficients, "Yeoh fit up to 300 % strain")
        yield _rubber(f"{name}-ogden", "ogden", {"mu": mu * 1e3, "alpha": alpha}, "one-term Ogden fit")


def _rubber(name: str, model: str, parameters: Mapping[str, float], fit: str) -> Material:
    return Material(
        name=name,
        model=model,
        parameters=parameters,
        poisson_ratio=0.5,
        source=_DATABASE.format(fit),
        spread=0.5,
    )


def _natural_rubbers() -> Iterator[Material]:
    for hardness, (modulus, ratio) in _NATURAL_RUBBER.items():
        source = f"Lindley, Engineering Design with Natural Rubber: E0 at {hardness} IRHD"
        yield _elastic(f"natural-rubber-{hardness}", modulus, ratio, source, 0.15)


def _elastic(
    name: str, youngs_modulus: float, poisson_ratio: float, source: str, spread: float, *, poisson_spread: float = 0.0
) -> Material:
    return Material(
        name=name,
        model="linear-elastic",
        parameters={"youngs_modulus": youngs_modulus},
        poisson_ratio=poisson_ratio,
        source=source,
        spread=spread,
        poisson_spread=poisson_spread,
    )


#: Named materials.
MATERIALS: Mapping[str, Material] = MappingProxyType(
    {
        material.name: material
        for material in (
            *_silicones(),
            *_natural_rubbers(),
            _elastic("neoprene", 3e6, 0.495, "solid neoprene, 2..5 MPa, nu 0.49..0.499", 0.5, poisson_spread=0.005),
            _elastic(
                "neoprene-sponge", 0.3e6, 0.15, "neoprene sponge, 0.1..0.6 MPa, nu 0..0.3", 0.6, poisson_spread=0.15
            ),
            _elastic("silicone-foam", 0.1e6, 0.15, "silicone foam, 10..300 kPa, nu 0..0.3", 0.8, poisson_spread=0.15),
            _elastic(
                "polyurethane-foam", 0.1e6, 0.15, "polyurethane foam, 10..300 kPa, nu 0..0.3", 0.8, poisson_spread=0.15
            ),
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
