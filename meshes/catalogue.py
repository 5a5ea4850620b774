"""Arrays, covers and materials that a user can name instead of describing them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType

import numpy as np

from meshes.array import TexelArray
from meshes.cover import Cover
from meshes.layer import Layer
from meshes.material import Material

#: Distance between the centres of neighbouring texels, along x and y, of the arrays in `ARRAYS` [m].
_PITCH = 3.4e-3

#: Text about the source of the silicones' parameters; the braces stand for the kind of fit.
_DATABASE = (
    "{} to the raw curves of the Soft Robotics Materials Database (Marechal et al. 2020); "
    "crosshead strain, so biased low; datasheet moduli are 1.1..3.7 times larger"
)

#: Fitted parameters of three material models for each silicone: neo-Hookean shear modulus mu [kPa]; Yeoh C1, C2, C3
#: [kPa]; one-term Ogden mu [kPa] and alpha [-].
_SILICONES: Mapping[str, tuple[float, tuple[float, float, float], tuple[float, float]]] = {
    "ecoflex-00-10": (8.0, (3.61, 0.138, -0.0002), (5.8, 2.91)),
    "ecoflex-00-30": (16.1, (7.83, 0.103, -0.0008), (14.4, 2.35)),
    "ecoflex-00-50": (22.4, (10.67, 0.261, -0.0033), (19.3, 2.52)),
    "dragon-skin-10": (56.4, (24.29, 2.250, -0.0543), (49.7, 2.86)),
    "dragon-skin-20": (160, (70.40, 5.223, -0.113), (136, 2.83)),
    "dragon-skin-30": (223, (100.6, 6.387, -0.149), (197, 2.72)),
    "rtv615": (403, (163.2, 13.86, 0.939), (224, 3.82)),
}

#: Natural rubber: hardness [IRHD], Young's modulus E [MPa], and Poisson ratio nu = 1/2 - E / (6 K) [-] for a bulk
#: modulus K of 1 GPa.
_NATURAL_RUBBER = ((30, 0.92, 0.4998), (40, 1.50, 0.4997), (50, 2.20, 0.4996), (60, 4.45, 0.4993), (70, 7.35, 0.4988))

#: Beginning of the source text of a material whose modulus is a typical value of unknown origin.  The range of the
#: modulus has the coverage factor k = 2.
_TYPICAL = "typical value without a source at hand (k = 2): "
#: Other linear elastic materials: name, source, Young's modulus E and the ends of its range [MPa], Poisson ratio and
#: half-width of the range of the Poisson ratio [-].
_OTHERS = (
    ("neoprene", "solid neoprene, 2..5 MPa, nu 0.49..0.499", 3, (2, 5), (0.4945, 0.0045)),
    ("neoprene-sponge", "neoprene sponge, 0.1..0.6 MPa, nu 0..0.3", 0.3, (0.1, 0.6), (0.15, 0.15)),
    ("silicone-foam", "silicone foam, 10..300 kPa, nu 0..0.3", 0.1, (0.01, 0.3), (0.15, 0.15)),
    ("polyurethane-foam", "polyurethane foam, 10..300 kPa, nu 0..0.3", 0.1, (0.01, 0.3), (0.15, 0.15)),
    ("pet", _TYPICAL + "PET film, +-30 %", 3500, (2450, 4550), (0.38, 0.0)),
    ("polyimide", _TYPICAL + "polyimide film (Kapton), +-20 %", 2500, (2000, 3000), (0.34, 0.0)),
    ("tpu", _TYPICAL + "polyurethane film, Shore 85 A..95 A, a factor of 3", 15, (5, 45), (0.48, 0.0)),
    ("latex", _TYPICAL + "natural latex sheet, +-40 %", 1.2, (0.72, 1.68), (0.499, 0.0)),
    (
        "sylgard-184",
        _TYPICAL + "PDMS Sylgard 184, 10 : 1, 1.3 MPa cured at room temperature to 3 MPa at 200 degC",
        2,
        (1.3, 3),
        (0.499, 0.0),
    ),
)


def _make_silicones() -> Iterator[Material]:
    """Yield three materials per silicone: the neo-Hookean fit under the silicone's name, and two fits with a suffix.

    The suffix of the name is the material model: `-yeoh` or `-ogden`.
    """
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


def _make_elastic(
    name: str, source: str, modulus_mpa: float, limits: tuple[float, float], poisson: tuple[float, float]
) -> Material:
    low, high = limits
    return Material(
        name=name,
        model="linear-elastic",
        parameters={"youngs_modulus": modulus_mpa * 1e6},
        poisson_ratio=poisson[0],
        source=source,
        spread=round(1 - low / modulus_mpa, 9),
        spread_above=round(high / modulus_mpa - 1, 9),
        poisson_spread=poisson[1],
    )


def _make_natural_rubbers() -> Iterator[Material]:
    for hardness, modulus, ratio in _NATURAL_RUBBER:
        source = f"Lindley, Engineering Design with Natural Rubber: E0 at {hardness} IRHD"
        yield _make_elastic(
            f"natural-rubber-{hardness}", source, modulus, (0.85 * modulus, 1.15 * modulus), (ratio, 0.0)
        )


#: Materials that a user can name, by name.
MATERIALS: Mapping[str, Material] = MappingProxyType(
    {
        material.name: material
        for material in (
            *_make_silicones(),
            *_make_natural_rubbers(),
            *(_make_elastic(*row) for row in _OTHERS),
        )
    }
)

#: Common names and abbreviations of materials, and the materials in `MATERIALS` that each may stand for.
COMMON_NAMES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        **dict.fromkeys(("pu", "pur", "polyurethane", "urethane"), ("tpu", "polyurethane-foam")),
        **dict.fromkeys(("silicone", "silicone-rubber"), ("ecoflex-00-30", "dragon-skin-20", "rtv615", "sylgard-184")),
        **dict.fromkeys(("rubber", "nr"), ("natural-rubber-40", "latex", "neoprene")),
        **dict.fromkeys(("foam", "sponge"), ("neoprene-sponge", "silicone-foam", "polyurethane-foam")),
        **dict.fromkeys(("chloroprene", "cr"), ("neoprene", "neoprene-sponge")),
        **dict.fromkeys(("polyester", "mylar"), ("pet",)),
        **dict.fromkeys(("pdms", "sylgard"), ("sylgard-184",)),
        **dict.fromkeys(("kapton", "pi"), ("polyimide",)),
    }
)

#: Cover of the Weiss WTS 0614-34 tactile sensor.  Material and thickness of the real cover are unpublished; 2 mm of
#: nearly incompressible rubber is a guess.
ASSUMED_COVER = Cover(
    layers=(
        Layer(
            thickness=2e-3,
            material=_make_elastic("assumed elastomer", "assumed: nobody published it", 1, (0.5, 1.5), (0.49, 0.0)),
        ),
    ),
    assumed=True,
)


#: Active texels of the tactile array in the fingertip of a SCHUNK SDH-2 hand: the first five of 13 rows have no texels
#: in the two outer columns.
_SDH2_MASK = np.ones((13, 6), dtype=bool)
_SDH2_MASK[:5, [0, 5]] = False

#: Tactile arrays that a user can name, by name: the Weiss WTS 0614-34 and the distal array of a SCHUNK SDH-2 finger.
ARRAYS: Mapping[str, TexelArray] = MappingProxyType(
    {
        "wts-0614-34": TexelArray.grid(14, 6, _PITCH, name="wts-0614-34"),
        "sdh2-distal": TexelArray.grid(13, 6, _PITCH, active=_SDH2_MASK, name="sdh2-distal"),
    }
)
