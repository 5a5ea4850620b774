"""Arrays, covers and materials that a user can name instead of describing them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType

import numpy as np

from meshes.array import TexelArray
from meshes.cover import Cover, Layer
from meshes.material import Material

#: Distance between neighbouring texels of both named arrays [m].
_PITCH = 3.4e-3

#: Source of the silicones; the kind of fit is filled in.
_DATABASE = (
    "{} to the raw curves of the Soft Robotics Materials Database (Marechal et al. 2020); "
    "crosshead strain, so biased low; datasheet moduli are 1.1..3.7 times larger"
)

#: Fits of each silicone: neo-Hookean mu [kPa]; Yeoh C1, C2, C3 [kPa]; one-term Ogden mu [kPa] and alpha [-].
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

#: Young's modulus E [Pa] of natural rubber by hardness [IRHD], and its Poisson ratio nu = 1/2 - E / (6 K) [-] for a
#: bulk modulus K of 1 GPa.
_NATURAL_RUBBER: Mapping[int, tuple[float, float]] = MappingProxyType(
    {
        30: (0.92e6, 0.4998),
        40: (1.50e6, 0.4997),
        50: (2.20e6, 0.4996),
        60: (4.45e6, 0.4993),
        70: (7.35e6, 0.4988),
    }
)


def _make_silicones() -> Iterator[Material]:
    """Materials of each silicone: the neo-Hookean fit under its name, the others with the model's name appended."""
    for name, (shear_modulus, yeoh, (mu, alpha)) in _SILICONES.items():
        yield _make_silicone(
            name, "neo-hookean", {"shear_modulus": shear_modulus * 1e3}, "neo-Hookean fit up to 100 % strain"
        )
        coefficients = dict(zip(("c1", "c2", "c3"), (1e3 * c for c in yeoh), strict=True))
        yield _make_silicone(f"{name}-yeoh", "yeoh", coefficients, "Yeoh fit up to 300 % strain")
        yield _make_silicone(f"{name}-ogden", "ogden", {"mu": mu * 1e3, "alpha": alpha}, "one-term Ogden fit")


def _make_silicone(name: str, model: str, parameters: Mapping[str, float], fit: str) -> Material:
    return Material(
        name=name,
        model=model,
        parameters=parameters,
        poisson_ratio=0.5,
        source=_DATABASE.format(fit),
        spread=0.5,
    )


def _make_natural_rubbers() -> Iterator[Material]:
    for hardness, (modulus, ratio) in _NATURAL_RUBBER.items():
        source = f"Lindley, Engineering Design with Natural Rubber: E0 at {hardness} IRHD"
        yield _make_elastic(f"natural-rubber-{hardness}", modulus, ratio, source, 0.15)


def _make_elastic(
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


#: Materials by name.
MATERIALS: Mapping[str, Material] = MappingProxyType(
    {
        material.name: material
        for material in (
            *_make_silicones(),
            *_make_natural_rubbers(),
            _make_elastic(
                "neoprene", 3e6, 0.495, "solid neoprene, 2..5 MPa, nu 0.49..0.499", 0.5, poisson_spread=0.005
            ),
            _make_elastic(
                "neoprene-sponge", 0.3e6, 0.15, "neoprene sponge, 0.1..0.6 MPa, nu 0..0.3", 0.6, poisson_spread=0.15
            ),
            _make_elastic(
                "silicone-foam", 0.1e6, 0.15, "silicone foam, 10..300 kPa, nu 0..0.3", 0.8, poisson_spread=0.15
            ),
            _make_elastic(
                "polyurethane-foam", 0.1e6, 0.15, "polyurethane foam, 10..300 kPa, nu 0..0.3", 0.8, poisson_spread=0.15
            ),
        )
    }
)

#: Cover of the WTS 0614-34.  Nobody published its material or thickness; 2 mm of nearly incompressible rubber is a
#: guess.
ASSUMED_COVER = Cover(
    layers=(
        Layer(
            thickness=2e-3,
            material=_make_elastic("assumed elastomer", 1e6, 0.49, "assumed: nobody published it", 0.5),
        ),
    ),
    assumed=True,
)


def _make_sdh2_mask() -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Active texels of the array in an SDH-2 fingertip: the two outer columns are missing in its first five rows."""
    active = np.ones((13, 6), dtype=bool)
    active[:5, [0, 5]] = False
    return active


#: Arrays by name: the Weiss WTS 0614-34 and the distal array of a SCHUNK SDH-2 finger.
ARRAYS: Mapping[str, TexelArray] = MappingProxyType(
    {
        "wts-0614-34": TexelArray.grid(14, 6, _PITCH, name="wts-0614-34"),
        "sdh2-distal": TexelArray.grid(13, 6, _PITCH, active=_make_sdh2_mask(), name="sdh2-distal"),
    }
)
