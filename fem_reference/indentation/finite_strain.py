"""Finite-strain pressing: one loading path per grid, shared by every pose and stored."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from scipy.interpolate import RectBivariateSpline

from fem_reference import result_store
from fem_reference.finite_strain.axisymmetric_path import press_axisymmetric
from fem_reference.finite_strain.block_path import lay_out
from fem_reference.finite_strain.loading_path import LoadingPath, with_grid
from fem_reference.finite_strain.paired_path import press_pair
from fem_reference.indentation import small_strain
from fem_reference.indentation.grid_solution import CorrectedLevel, ExtrapolatedLevel, Level, shared_out
from fem_reference.linear_response.point_spread import PointSpread, closed, decay_length
from fem_reference.small_strain_contact.frictionless import is_flat
from meshes import Cover, Indenter, TexelArray
from meshes.indenters.indenter import Flat
from meshes.pose import Pose

FloatArray = npt.NDArray[np.float64]

#: Elements through the cover on the three grids; the last one is the answer.
GRIDS = (6, 9, 13)
SOLID_GRIDS = (2, 3, 4)


@dataclass(frozen=True, kw_only=True, eq=False)
class RadialLevel:
    """One grid's answer around an axis.

    Attributes:
        total_force: Force on the indenter [N].
        depth: Approach from first touch [m].
        area: Reference area that touches [m2].
        overlap: Mean distance that contact left between the surfaces, over the depth [-].
        spread: Base pressure per unit force.
    """

    total_force: float
    depth: float
    area: float
    overlap: float
    spread: PointSpread

    @property
    def surface(self) -> FloatArray:
        """Rings of equal force that fill the contact, in the indenter's frame: x, y [m], force [N], shape (m, 3)."""
        turn = np.arange(400) * np.pi * (3 - np.sqrt(5))
        radius = np.sqrt((np.arange(400) + 0.5) / 400 * self.area / np.pi)
        return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), np.full(400, self.total_force / 400)])

    def texel_forces(self, array: TexelArray, at: tuple[float, float], yaw: float) -> FloatArray:  # noqa: ARG002
        """Integrate the base pressure over each texel; a turn about the axis changes nothing."""
        return self.total_force * np.asarray(self.spread.texel_influence(array, at)[0])


@dataclass(frozen=True, kw_only=True, eq=False)
class PlaneLevel:
    """One grid's answer for a shape without an axis.

    Attributes:
        total_force: Force on the indenter [N].
        depth: Approach from first touch [m].
        area: Reference area that touches [m2].
        overlap: Mean distance that contact left between the surfaces, over the depth [-].
        half: Half widths of the shape's footprint [m].
        x: Where the base pressure is known in the indenter's frame, shape (m,) [m].
        y: Shape (n,) [m].
        pressure: Base pressure, shape (m, n) [Pa].
    """

    total_force: float
    depth: float
    area: float
    overlap: float
    half: tuple[float, float]
    x: FloatArray
    y: FloatArray
    pressure: FloatArray

    @property
    def surface(self) -> FloatArray:
        """The base pressure's points under the shape, as a stand-in for where it touches, shape (m, 3)."""
        return shared_out(self, Pose())

    def texel_forces(self, array: TexelArray, at: tuple[float, float], yaw: float) -> FloatArray:
        """Integrate the base pressure over each texel, turned into the indenter's frame."""
        nodes, weights = np.polynomial.legendre.leggauss(_POINTS)
        half = np.array(array.texel_size) / 2
        offset = np.stack(np.meshgrid(nodes * half[0], nodes * half[1]), axis=-1).reshape(-1, 2)
        place = array.centres[:, None, :2] + offset
        x, y = Pose(at=at, yaw=yaw).local(place[..., 0], place[..., 1])
        inside = (x > self.x[0]) & (x < self.x[-1]) & (y > self.y[0]) & (y < self.y[-1])
        value = np.where(inside, RectBivariateSpline(self.x, self.y, self.pressure).ev(x, y), 0.0)
        force = value @ np.outer(weights, weights).ravel() * half[0] * half[1]
        return np.where(array.active, force, 0.0)


#: Gauss points along a texel's edge.
_POINTS = 16


def levels(
    cover: Cover,
    indenter: Indenter,
    targets: Sequence[float],
    control: Literal["load", "depth"],
    progress: Callable[[str], None] | None,
    *,
    friction: float = 0.0,
) -> list[list[Level]]:
    """The path on three grids, from the store where it is known; a list of grids for every target.

    Shapes with sharp edges or without an axis are answered as corrections of the converged frictionless small-strain
    solution, see `CorrectedLevel`.
    """
    path = LoadingPath(cover=cover, indenter=indenter, targets=tuple(targets), control=control, friction=friction)
    if not _corrected(indenter):
        return _around_axis(path.at_its_strain, progress)
    known = small_strain.levels(cover, indenter, targets, control, progress)
    return corrected(path, known, partial(_both, progress=progress))


#: A path on three grids, twice: without friction at small strain, and as asked for; a list of grids for every target.
Twice = tuple[list[list[Level]], list[list[Level]]]


def corrected(
    path: LoadingPath,
    known: Sequence[Sequence[Level]],
    solve: Callable[[LoadingPath, Sequence[float]], Twice],
) -> list[list[Level]]:
    """The path as corrections of the frictionless small-strain answer.

    Args:
        path: What was asked for.
        known: Small-strain grids of every target.
        solve: The path twice on three coarse grids, from the path and its small-strain depths [m].
    """
    flat = is_flat(path.indenter)
    wanted = list(path.targets)
    if flat and not path.friction:
        wanted = _resolved(wanted, [grids[-1].depth / (_SHALLOW * path.cover.thickness) for grids in known])
    depth = {
        stop: grids[-1].depth * stop / target for target, stop, grids in zip(path.targets, wanted, known, strict=True)
    }
    stops = sorted(depth)
    rest, deep = solve(replace(path, targets=tuple(stops)).at_its_strain, [depth[stop] for stop in stops])
    out: list[list[Level]] = []
    for target, stop, grids in zip(path.targets, wanted, known, strict=True):
        at = stops.index(stop)
        exact: Level = grids[-1]
        if flat:
            exact = ExtrapolatedLevel(levels=grids, sizes=small_strain.sizes(path.indenter))
        level = partial(CorrectedLevel, exact=exact, control=path.control, share=target / stop)
        triples = zip(rest[at], deep[at], grids, strict=True)
        out.append([level(rest=a, deep=b, touched=c if flat else None) for a, b, c in triples])
    return out


def _resolved(targets: Sequence[float], relative: Sequence[float]) -> list[float]:
    """Targets raised to where a rounded edge's contact is as wide as an element.

    Args:
        targets: Loads or depths, ascending.
        relative: Small-strain depth of each over that least depth [-].
    """
    least = targets[0] / relative[0]
    shared = next((target for target in targets if least <= target <= 2 * least), least)
    return [target if target >= least else shared for target in targets]


#: Depth over thickness from which finite strain is told from the noise of a grid under a flat face [-].
_SHALLOW = 0.04


def _both(path: LoadingPath, approaches: Sequence[float], progress: Callable[[str], None] | None) -> Twice:
    """The path twice: around the axis one after the other, in space together."""
    if path.indenter.axisymmetric:
        return _around_axis(path.at_rest, progress), _around_axis(path, progress)
    inputs = {"path": path, "grids": SOLID_GRIDS, "fillet": fillet(path.cover, path.indenter)}
    data = result_store.fetch("finite-press", inputs, lambda: _in_space(path, approaches, progress))
    rest, deep = (
        [[_plane(data, each, name, n, i) for n in SOLID_GRIDS] for i in range(len(path.targets))]
        for name, each in (("rest", path.at_rest), ("deep", path))
    )
    return rest, deep


def sizes(indenter: Indenter) -> list[float]:
    """Element sizes of the three grids, relative to the thickness [-]."""
    return [1 / n for n in (GRIDS if indenter.axisymmetric else SOLID_GRIDS)]


def least_order(indenter: Indenter) -> float:
    """Smallest order of convergence believed of what `levels` gives [-].

    Corrections of the small-strain answer are free of what a sharp edge's singularity does to a grid; of them the order
    of smooth solutions is expected.
    """
    return 2.0 if _corrected(indenter) else 1.0


def _corrected(indenter: Indenter) -> bool:
    return is_flat(indenter) or not indenter.axisymmetric


def assumptions(cover: Cover, indenter: Indenter) -> dict[str, str]:
    """How sharp edges and facets were treated."""
    return rounded(indenter, fillet(cover, indenter))


def rounded(indenter: Indenter, size: float) -> dict[str, str]:
    """What a result says of a rounding [m]."""
    if is_flat(indenter):
        rounding = f"rounded with {size * 1e3:.3g} mm on the finest grid"
        lost = f"; walls thinner than {2e3 * size:.3g} mm are left out of that" if _vanishing(indenter, size) else ""
        return {"edge": f"sharp at small strain, {rounding} for what finite strain or friction adds{lost}"}
    return {} if indenter.axisymmetric else {"surface": f"facets and edges rounded over {size * 1e3:.3g} mm"}


def _vanishing(indenter: Indenter, size: float) -> bool:
    """Whether some of a face is so thin that its rounding leaves nothing of it."""
    if indenter.axisymmetric or not isinstance(indenter, Flat):
        return False
    x, y = _samples(indenter.footprint)
    far = indenter.beyond(size, x, y) > _CORNER * size
    return bool((far & (indenter.inside(x, y) >= 0)).any())


#: How far in front of what an inset leaves the corner of an outline may stand, in insets: one of 50 degrees [-].
_CORNER = 2.4


def _samples(footprint: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
    """Places all over a footprint [m]."""
    x, y = np.meshgrid(*(np.linspace(-half, half, _SAMPLES) for half in footprint))
    return x, y


def fillet(cover: Cover, indenter: Indenter) -> float:
    """Radius of the rounding of sharp edges on the finest grid, as small as the mesh around it can resolve [m]."""
    if indenter.axisymmetric:
        return min(cover.thickness, *indenter.footprint) / 20
    return solid_fillet(cover, indenter)


def solid_fillet(cover: Cover, indenter: Indenter) -> float:
    """The same where grids are coarse, in three dimensions; the coarsest leaves something of the thickest wall [m]."""
    within = min(indenter.footprint)
    if isinstance(indenter, Flat):
        within = min(within, 2 * float(indenter.inside(*_samples(indenter.footprint)).max()))
    if within < _THINNEST * max(indenter.footprint):
        raise ValueError(
            f"no wall of the indenter's face is wider than about {max(within, 0) * 1e3:.2g} mm, too thin beside "
            f"{2e3 * max(indenter.footprint):.3g} mm for the grids of finite strain and friction; press it without "
            "friction into linear-elastic layers"
        )
    return min(cover.thickness, within) / 5


#: Width of the thickest wall over half the footprint that grids still resolve [-].
_THINNEST = 0.05


#: Places along each side at which a face is asked how far inside they lie.
_SAMPLES = 81


def on_grid(fillet: float, n: int, grids: Sequence[int]) -> float:
    """The rounding on a grid: as much coarser as the grid, so that the spread of the grids tells what it does [m]."""
    return fillet * grids[-1] / n


def _around_axis(path: LoadingPath, progress: Callable[[str], None] | None) -> list[list[Level]]:
    inputs = {"path": path, "grids": GRIDS, "fillet": fillet(path.cover, path.indenter)}
    data = result_store.fetch("finite-press", inputs, lambda: _solved_around_axis(path, progress))
    return [[_radial(data, path, n, i) for n in GRIDS] for i in range(len(path.targets))]


def _solved_around_axis(path: LoadingPath, progress: Callable[[str], None] | None) -> dict[str, Any]:
    cover, indenter = path.cover, path.indenter
    radius = _contact_radius(cover, indenter, path.targets[-1], path.control)
    reach = 12 * decay_length(cover) + 1.5 * radius
    out: dict[str, Any] = {}
    coarse = None
    for n in GRIDS:
        states, coarse = press_axisymmetric(
            path,
            elements_per_thickness=n,
            contact_radius=radius,
            fillet=on_grid(fillet(cover, indenter), n, GRIDS),
            reach=reach,
            coarse=coarse,
            progress=with_grid(progress, n),
        )
        for i, state in enumerate(states):
            for name, values in closed(state.base, reach).items():
                out[f"{name}_{n}_{i}"] = values
            out[f"scalars_{n}_{i}"] = np.array([state.load, state.depth, state.area, state.overlap / state.depth])
    return out


def _in_space(path: LoadingPath, approaches: Sequence[float], progress: Callable[[str], None] | None) -> dict[str, Any]:
    cover, indenter = path.cover, path.indenter
    out: dict[str, Any] = {}
    pair = None
    for n in SOLID_GRIDS:
        block = lay_out(
            path,
            elements_per_thickness=n,
            contact_half=_contact_half(cover, indenter, path.targets[-1], path.control),
            fillet=on_grid(fillet(cover, indenter), n, SOLID_GRIDS),
            reach=7 * decay_length(cover),
        )
        rest, deep, pair = press_pair(
            path, block, approaches, elements_per_thickness=n, before=pair, progress=with_grid(progress, n)
        )
        for name, states in (("rest", rest), ("deep", deep)):
            for i, state in enumerate(states):
                here = f"{name}_{n}_{i}"
                out |= {f"x_{here}": state.x, f"y_{here}": state.y, f"pressure_{here}": state.pressure}
                out[f"scalars_{here}"] = np.array([state.load, state.depth, state.area, state.overlap / state.depth])
    return out


def _contact_half(
    cover: Cover, indenter: Indenter, target: float, control: Literal["load", "depth"]
) -> tuple[float, float]:
    """Half widths of the small-strain contact, or of a flat shape, which a mesh is laid out for [m]."""
    if is_flat(indenter):
        return indenter.footprint
    surface = small_strain.levels(cover, indenter, [target], control, None)[0][0].surface
    return (float(np.abs(surface[:, 0]).max()), float(np.abs(surface[:, 1]).max()))


def _contact_radius(cover: Cover, indenter: Indenter, target: float, control: Literal["load", "depth"]) -> float:
    """Contact radius of the small-strain solution, which a mesh is laid out for [m]."""
    if is_flat(indenter):
        return max(indenter.footprint)
    surface = small_strain.levels(cover, indenter, [target], control, None)[0][0].surface
    return float(np.hypot(surface[:, 0], surface[:, 1]).max())


def _radial(data: dict[str, Any], path: LoadingPath, n: int, i: int) -> Level:
    load, depth, area, overlap = (float(value) for value in data[f"scalars_{n}_{i}"])
    spread = PointSpread(
        radius=data[f"radius_{n}_{i}"],
        pressure_per_force=data[f"pressure_{n}_{i}"] / load,
        reaction=float(data[f"reaction_{n}_{i}"]) / load,
        thickness=path.cover.thickness,
    )
    return RadialLevel(
        total_force=load / path.steepness, depth=depth / path.steepness, area=area, overlap=overlap, spread=spread
    )


def _plane(data: dict[str, Any], path: LoadingPath, name: str, n: int, i: int) -> Level:
    here = f"{name}_{n}_{i}"
    load, depth, area, overlap = (float(value) for value in data[f"scalars_{here}"])
    return PlaneLevel(
        total_force=load / path.steepness,
        depth=depth / path.steepness,
        area=area,
        overlap=overlap,
        half=path.indenter.footprint,
        x=data[f"x_{here}"],
        y=data[f"y_{here}"],
        pressure=data[f"pressure_{here}"] / path.steepness,
    )
