"""Cases of tactilebench as covers, arrays, bodies and poses of softcover, and the size of their intervals."""

from __future__ import annotations

from functools import cache

import numpy as np

from meshes import (
    Box,
    Cover,
    Cylinder,
    Indenter,
    Layer,
    LetterH,
    Material,
    Nut,
    Pose,
    Roller,
    RoundedTip,
    SolidCover,
    Sphere,
    TexelArray,
    TriangleMesh,
)
from meshes.array_types import FloatArray
from meshes.solids import fingertip, flat_pad, phalanx
from meshes.solids.covers import make_swept_cover
from tactilebench import Body, Case

#: Solid covers by name.
SOLIDS = {"fingertip": fingertip, "phalanx": phalanx, "flat-pad": flat_pad}
#: Shapes whose numbers have the same names in softcover.
_SHAPES: dict[str, type[Indenter]] = {
    "sphere": Sphere, "tip": RoundedTip, "cylinder": Cylinder, "box": Box, "roller": Roller, "nut": Nut, "h": LetterH,
}  # fmt: skip
#: Texels with less of the load do not count where intervals are judged [-].
COUNTED = 0.01
#: Largest median half width over the load with which a case is shipped; of the tiers that are not named the first [-].
WIDEST = {"": 3e-3, "finite_strain": 1e-2, "friction": 1e-2, "curved": 1e-2}


def make_indenter(body: Body) -> Indenter:
    """Make the body of a case."""
    numbers = dict(body.shape)
    kind = numbers.pop("shape")
    if kind == "triangles":
        return TriangleMesh(triangles=np.array(numbers["vertices"])[np.array(numbers["faces"])])
    return _SHAPES[kind](**{key: tuple(each) if isinstance(each, list) else each for key, each in numbers.items()})


def make_pose(body: Body, at: tuple[float, float, float] | None = None) -> Pose:
    """Make the pose of a body, at another position if one is given [m]."""
    return Pose(point=at or body.at, direction=body.direction, yaw=body.yaw, tilt=body.tilt)


def make_layers(case: Case) -> tuple[Layer, ...]:
    """Make the layers of a cover, from base to top."""
    layers = []
    for each in case.cover.layers:
        modulus, ratio = each.youngs_modulus, each.poisson_ratio
        linear = each.law == "linear-elastic"
        parameters = {"youngs_modulus": modulus} if linear else {"shear_modulus": modulus / (2 * (1 + ratio))}
        material = Material(name=each.law, model=each.law, parameters=parameters, poisson_ratio=ratio)
        layers.append(Layer(thickness=each.thickness, material=material))
    return tuple(layers)


def make_cover(case: Case) -> Cover | SolidCover:
    """Make the cover of a case."""
    layers = make_layers(case)
    if not case.cover.geometry:
        return Cover(layers=layers, size=case.cover.size)
    return make_swept_cover(_make_solid(case.cover.geometry), layers[0].material, case.cover.geometry)


@cache
def _make_solid(name: str):  # noqa: ANN202 -- a swept cover
    return SOLIDS[name]()


def make_array(case: Case) -> TexelArray:
    """Make the array of a case.

    Raises:
        ValueError: If its texels are not those of the case.
    """
    if case.cover.geometry:
        array = _make_solid(case.cover.geometry).texels
    else:
        array = TexelArray.grid(case.rows, case.columns, case.pitch, texel_size=case.texel_size)
    if not np.allclose(array.centres, case.centres, rtol=0, atol=1e-9):
        raise ValueError(f"the texels of {case.name} are not those of softcover")
    return array


def measure_width(case: Case, forces: FloatArray, half_width: FloatArray) -> float:
    """Return the median half width of the intervals of the texels above `COUNTED` of the load, over the load [-].

    Args:
        case: The case.
        forces: Forces, in the shape of the case [N].
        half_width: Half widths, in the same shape [N].
    """
    loads = np.reshape(case.loads, (-1, 1))
    counted = np.abs(forces.reshape(len(loads), -1)) > COUNTED * loads
    shares = (half_width.reshape(len(loads), -1) / loads)[counted]
    return float(np.median(shares)) if len(shares) else float("nan")


def find_limit(case: Case) -> float:
    """Return the largest median half width over the load with which a case is shipped [-]."""
    return WIDEST.get(case.tier, WIDEST[""])
