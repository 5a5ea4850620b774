"""Drawing of cases by seed, tier by tier, with results that depend on no version of Python or numpy.

Sizes are drawn relative to the cover's thickness h.  Loads follow from an approximate depth, so that the strain stays
small except in the tier of finite strain, and contacts stay wide against the cells of the solver.
"""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from dataclasses import dataclass, replace
from numbers import Integral
from typing import Any, TypeVar

import numpy as np

from tactilebench.case import BenchError, Body, Case, Cover, Layer, Motion, read_geometry

T = TypeVar("T")

#: Seed of the cases of each release.
RELEASES = {"2026.1": 20261}
#: Number of cases, and range of the approximate depth over the thickness, of each tier.  Cases whose truth is too
#: uncertain are left out of a release.
TIERS = {
    "linear": (150, (0.04, 0.2)),
    "layered": (84, (0.04, 0.2)),
    "finite_strain": (42, (0.3, 0.7)),
    "foil": (32, (0.02, 0.08)),
    "friction": (42, (0.05, 0.2)),
    "two_bodies": (42, (0.05, 0.15)),
    "curved": (42, (0.04, 0.1)),
    "moving": (32, (0.04, 0.2)),
}
#: Shapes of the tiers, each as often as it stands here.
_SHAPES = {
    "finite_strain": ("sphere", "sphere", "cylinder"),
    "foil": ("sphere", "sphere", "cylinder", "box", "roller"),
    "friction": ("sphere", "cylinder", "cylinder", "box"),
    "two_bodies": ("sphere", "cylinder", "box"),
    "curved": ("sphere", "sphere", "cylinder", "box"),
    "moving": ("sphere", "sphere", "cylinder", "box", "roller"),
}
_EVERY_SHAPE = ("sphere", "sphere", "cylinder", "box", "box", "roller", "nut", "h", "triangles")
#: Arrays: rows, columns, pitch along x and y, and edge length of a texel over the pitch.
_ARRAYS = (
    (14, 6, (3.4e-3, 3.4e-3), 1.0),
    (14, 6, (3.4e-3, 3.4e-3), 1.0),
    (8, 8, (2e-3, 2e-3), 1.0),
    (12, 12, (1.5e-3, 1.5e-3), 1.0),
    (5, 5, (5e-3, 5e-3), 0.9),
    (10, 6, (3e-3, 4e-3), 0.85),
)
#: Solid covers: radius of the top, 0 if it is flat, and the extent along y over which cases are drawn [m].
_SOLIDS = {"fingertip": (8e-3, (-10e-3, 0.0)), "phalanx": (8e-3, (-6e-3, 6e-3)), "flat-pad": (0.0, (-4e-3, 4e-3))}


class Draws:
    """Random numbers of one case."""

    def __init__(self, key: str) -> None:
        self._random = random.Random(key)  # noqa: S311 -- no secret

    def pick(self, items: Sequence[T]) -> T:
        """Return one of the items."""
        return items[int(self._random.random() * len(items))]

    def between(self, low: float, high: float) -> float:
        """Return a number between two limits."""
        return low + (high - low) * self._random.random()

    def log(self, low: float, high: float) -> float:
        """Return a number between two positive limits, uniform in its logarithm."""
        return low * math.exp(self.between(0, math.log(high / low)))

    def chance(self, share: float) -> bool:
        """Return True in a share of the draws."""
        return self._random.random() < share


@dataclass(frozen=True)
class _Face:
    """A drawn shape with its numbers.

    Attributes:
        shape: Name and numbers.
        radius: Radius of a circle of the area of the flat face; radius of curvature of a round one [m].
        reach: Largest distance of a point of the shape from its axis, in plan [m].
        length: Length of a roller; 0 for a ball, and negative for a flat face [m].
    """

    shape: dict[str, Any]
    radius: float
    reach: float
    length: float = -1.0


def draw(version: str, seed: int | None = None) -> tuple[Case, ...]:
    """Draw the cases of every tier, without truth.

    Args:
        version: Version of the benchmark.
        seed: Seed of fresh cases; None for the seed of the release.

    Raises:
        BenchError: If the version is unknown, or the seed is no whole number from 0 on.
    """
    if version not in RELEASES:
        raise BenchError(f"version {version!r} is unknown; this package holds {', '.join(RELEASES)}")
    if seed is not None and (isinstance(seed, bool) or not isinstance(seed, Integral) or seed < 0):
        raise BenchError(f"seed {seed!r}: let it be a whole number from 0 on")
    mark, root = ("", RELEASES[version]) if seed is None else (f"-s{seed}", seed)
    made = []
    for tier, (count, _) in TIERS.items():
        for k in range(count):
            draws, about = Draws(f"{version}/{root}/{tier}/{k}"), (f"{tier}-{k:03d}{mark}", tier, version)
            made.append(_draw_solid(draws, *about) if tier == "curved" else _draw_flat(draws, *about))
    return tuple(made)


def _draw_flat(draws: Draws, name: str, tier: str, version: str) -> Case:
    """Draw a press on flat layers."""
    rows, columns, (dx, dy), share = draws.pick(_ARRAYS)
    cover = _draw_cover(draws, tier, (columns * dx, rows * dy))
    face = _draw_face(draws, tier, cover.thickness)
    bodies = [_place(draws, face, cover, (columns * dx / 2, rows * dy / 2), tier)]
    if tier == "two_bodies":
        bodies.append(_place_beside(draws, face, bodies[0], cover))
    x, y = np.meshgrid((np.arange(columns) - (columns - 1) / 2) * dx, (np.arange(rows) - (rows - 1) / 2) * dy)
    return Case(
        name=name, tier=tier, version=version, bodies=tuple(bodies), cover=cover, rows=rows,
        columns=columns, pitch=(dx, dy), texel_size=(_round(share * dx), _round(share * dy)),
        motion=_draw_motion(draws, bodies[0], max(dx, dy)) if tier == "moving" else None,
        normals=np.tile([0.0, 0.0, 1.0], (rows * columns, 1)),
        centres=np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3),
    )  # fmt: skip


def _draw_cover(draws: Draws, tier: str, extent: tuple[float, float]) -> Cover:
    """Draw the layers, the friction, and for some linear covers free sides near the array."""
    h, modulus = draws.log(1e-3, 4e-3), draws.log(1e5, 3e6)
    ratio = draws.pick((0.3, 0.4, 0.45, 0.48, 0.49) + (0.495, 0.499) * (tier in {"linear", "moving", "finite_strain"}))
    parts, friction, size = [(h, modulus, ratio)], 0.0, None
    if tier == "layered":
        shares = [draws.between(0.5, 1.5) for _ in range(draws.pick((2, 2, 3)))]
        parts = [
            (h * share / sum(shares), modulus * draws.log(0.2, 5), draws.pick((0.3, 0.4, 0.45, 0.48, 0.49)))
            for share in shares
        ]
    elif tier == "foil":
        parts.append((h * draws.log(0.03, 0.1), modulus * draws.log(20, 500), draws.pick((0.34, 0.38, 0.45))))
    elif tier == "friction":
        friction = draws.pick((0.2, 0.4, 0.7, 1.0, math.inf))
    elif tier == "linear" and draws.chance(0.08):
        wide = [_round(edge + 2 * draws.between(0.5, 1.5) * h) for edge in extent]
        size = (wide[0], wide[1])
    law = "neo-hookean" if tier == "finite_strain" else "linear-elastic"
    layers = [Layer(thickness=_round(a), youngs_modulus=_digits(b), poisson_ratio=c, law=law) for a, b, c in parts]
    return Cover(layers=tuple(layers), friction=friction, size=size)


def _draw_face(draws: Draws, tier: str, h: float) -> _Face:
    """Draw a shape with a size of about one to several thicknesses h [m]."""
    kind, a = draws.pick(_SHAPES.get(tier, _EVERY_SHAPE)), _round(max(1.2e-3, h * draws.log(0.8, 2.2)))
    b, radius, length = _round(a * draws.log(1, 2.2)), _round(h * draws.log(1.5, 6)), _round(h * draws.log(2, 5))
    bore, height = _round(4 * a * draws.between(0.45, 0.62)), _round(draws.between(0.4, 0.8) * a)
    made: dict[str, tuple[dict[str, Any], float, float, float]] = {
        "sphere": ({"radius": radius}, radius, radius, 0.0),
        "roller": ({"radius": radius, "length": length}, radius, radius + length / 2, length),
        "cylinder": ({"radius": a}, a, a, -1.0),
        "box": ({"size": (_round(2 * a), _round(2 * b), 8e-3)}, math.sqrt(a * b), math.hypot(a, b), -1.0),
        "nut": ({"across": _round(4 * a), "bore": bore}, 1.7 * a, 2.4 * a, -1.0),
        "h": ({"size": (_round(4 * a), _round(4.8 * a)), "bar": _round(1.2 * a)}, 1.9 * a, 3.2 * a, -1.0),
        "triangles": (_make_pyramid(2 * a, 2 * b, height), 2 * a, 2 * math.hypot(a, b), 0.0),
    }
    shape, *sizes = made[kind]
    return _Face({"shape": kind, **shape}, *sizes)


def _make_pyramid(a: float, b: float, height: float) -> dict[str, Any]:
    """Return a pyramid that stands on its tip, with the half edge lengths a and b of its upper face [m]."""
    corners = [(_round(i * a), _round(j * b), height) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    faces = ((0, 1, 2), (0, 2, 3), (4, 1, 0), (4, 2, 1), (4, 3, 2), (4, 0, 3))
    return {"vertices": (*corners, (0.0, 0.0, 0.0)), "faces": faces}


def _find_load(draws: Draws, face: _Face, cover: Cover, depth: float) -> float:
    """Return a load that sinks a face to about a depth [m], from half spaces and a stiffer thin layer [N]."""
    h = cover.thickness
    modulus = 1 / sum(each.thickness / h * (1 - each.poisson_ratio**2) / each.youngs_modulus for each in cover.layers)
    contact = min(math.sqrt(face.radius * depth), 0.6 * face.radius)
    load = 4 / 3 * modulus * contact**3 / face.radius * (1 + 0.4 * contact / h)
    if face.length > 0:
        load = modulus * face.length * contact**2 / face.radius
    elif face.length < 0:
        load = 2 * modulus * min(face.radius, 2 * h) * depth * (1 + face.radius / h)
    return _digits(load * draws.between(0.6, 1))


def _place(draws: Draws, face: _Face, cover: Cover, half: tuple[float, float], tier: str) -> Body:
    """Place a body over the array, whose half extents are given [m]: anywhere, or over the middle."""
    reach = 0.4 if tier in {"moving", "two_bodies"} else draws.pick((0.0, 0.5, 0.8, 1.0))
    x, y = (reach * draws.between(-each, each) for each in half)
    yaw, tilt = 0.0, (0.0, 0.0)
    if face.shape["shape"] not in {"sphere", "cylinder"}:
        yaw = math.radians(draws.pick((0, 30, 45, 90, draws.between(0, 180))))
    if tier in {"linear", "layered"} and face.length < 0 and draws.chance(0.25):
        tilt = (_round(draws.between(-0.03, 0.03)), _round(draws.between(-0.03, 0.03)))
    load = _find_load(draws, face, cover, draws.between(*TIERS[tier][1]) * cover.thickness)
    return Body(
        shape=face.shape, at=(_round(x), _round(y), _round(cover.thickness)), yaw=_round(yaw), tilt=tilt, load=load
    )


def _place_beside(draws: Draws, face: _Face, first: Body, cover: Cover) -> Body:
    """Place a second body beside the first one, with a load of the same order, so that neither lifts the other."""
    other = _draw_face(draws, "two_bodies", cover.thickness)
    body, angle = _place(draws, other, cover, (0.0, 0.0), "two_bodies"), draws.between(0, 2 * math.pi)
    apart = face.reach + other.reach + draws.between(0.3, 2.5) * cover.thickness
    x, y, z = first.at
    return replace(body, at=(_round(x + apart * math.cos(angle)), _round(y + apart * math.sin(angle)), z))


def _draw_motion(draws: Draws, body: Body, pitch: float) -> Motion:
    """Draw a growing load, or a slide, which without friction is also the roll of a round body."""
    count, grows = draws.pick((5, 6, 8)), draws.chance(0.35)
    angle, way = draws.pick((body.yaw, draws.between(0, 2 * math.pi))), draws.between(1, 3) * pitch * (not grows)
    (x, y, z), ways = body.at, [way * (k / (count - 1) - 0.5) for k in range(count)]
    at = [(_round(x + each * math.cos(angle)), _round(y + each * math.sin(angle)), z) for each in ways]
    loads = [_digits(body.load * ((k + 1) / count) ** (2 * grows)) for k in range(count)]
    return Motion(times=tuple(_round(0.1 * k) for k in range(count)), at=tuple(at), loads=tuple(loads))


def _draw_solid(draws: Draws, name: str, tier: str, version: str) -> Case:
    """Draw a press on a solid cover, along its normal or up to 20 degrees from it."""
    geometry = draws.pick(tuple(_SOLIDS))
    (radius, extent), arrays = _SOLIDS[geometry], read_geometry(geometry)
    h, rows, columns, *sizes = arrays["sizes"].tolist()
    layer = Layer(thickness=h, youngs_modulus=1e6, poisson_ratio=0.49)  # each other one takes minutes to solve
    turn, rise, y = draws.between(-0.7, 0.7), 0.0, draws.between(*extent)
    if geometry == "fingertip" and draws.chance(0.3):
        rise, y = draws.between(0, 0.8), 0.0
    normal = (math.cos(rise) * math.sin(turn), math.sin(rise), math.cos(rise) * math.cos(turn))
    at = (radius * normal[0], y + radius * normal[1], radius * normal[2])
    if not radius:
        normal, at = (0.0, 0.0, 1.0), (draws.between(*extent), y, h)
    face = _draw_face(draws, tier, h)
    lean = 0.25 * (draws.chance(0.5) and not face.length)
    towards = np.array([draws.between(-lean, lean) - each for each in normal])
    along = np.round(towards / np.linalg.norm(towards), 9).tolist()
    cover = Cover(layers=(layer,), geometry=geometry)
    body = _place(draws, face, cover, (0.0, 0.0), tier)
    body = replace(
        body, at=(_round(at[0]), _round(at[1]), _round(at[2])), load=_digits(0.4 * body.load),
        direction=(along[0], along[1], along[2]),
    )  # fmt: skip
    return Case(
        name=name, tier=tier, version=version, bodies=(body,), cover=cover, rows=round(rows), columns=round(columns),
        pitch=(sizes[0], sizes[1]), texel_size=(sizes[2], sizes[3]), centres=arrays["centres"],
        normals=arrays["normals"],
    )  # fmt: skip


def _round(value: float) -> float:
    """Round a length to 1 um, or an angle to 1 urad, so that the last digits of a computer's sine do not matter."""
    return round(value, 6) + 0.0


def _digits(value: float) -> float:
    """Round to four significant digits."""
    return float(f"{value:.4g}")
