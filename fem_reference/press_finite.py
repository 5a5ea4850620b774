"""Finite-strain pressing: one loading path per grid, shared by every pose and stored."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from scipy.interpolate import RectBivariateSpline

from fem_reference import press_linear, store
from fem_reference.contact import is_flat
from fem_reference.level import CorrectedLevel, ExtrapolatedLevel, Level, shared_out
from fem_reference.point_spread import PointSpread, closed, decay_length
from fem_reference.pose import Pose
from fem_reference.press_axisymmetric import press_axisymmetric
from fem_reference.press_solid import press_solid
from meshes import Cover, Indenter, TexelArray

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
        spread: Base pressure per unit force.
    """

    total_force: float
    depth: float
    area: float
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
        half: Half widths of the shape's footprint [m].
        x: Where the base pressure is known in the indenter's frame, shape (m,) [m].
        y: Shape (n,) [m].
        pressure: Base pressure, shape (m, n) [Pa].
    """

    total_force: float
    depth: float
    area: float
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


@dataclass(frozen=True, kw_only=True)
class LoadingPath:
    """One path of loads or depths.

    Attributes:
        cover: The cover; a small-strain material counts as neo-Hookean with the same moduli.
        indenter: The shape.
        targets: Loads [N] or depths [m], ascending.
        control: Which of the two.
        friction: Coefficient of Coulomb's law, inf for no slip [-].
        steepness: Factor on targets and on the indenter's heights; far below one there is no strain to speak of and the
            answer, divided by it again, is that of small strain [-].
    """

    cover: Cover
    indenter: Indenter
    targets: tuple[float, ...]
    control: Literal["load", "depth"]
    friction: float = 0.0
    steepness: float = 1.0

    @property
    def scaled(self) -> list[float]:
        """What the solver is asked for [N] or [m]."""
        return [self.steepness * target for target in self.targets]

    @property
    def at_its_strain(self) -> LoadingPath:
        """The path at the strain that the materials ask for: small where all of them are small-strain models."""
        small = all(layer.material.small_strain_only for layer in self.cover.layers)
        return replace(self, steepness=_REST if small else 1.0)


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
        return _on_grids(path.at_its_strain, progress)
    known = [press_linear.levels(cover, indenter, [target], control, progress)[0] for target in targets]
    return corrected(path, known, lambda each: _on_grids(each, progress))


def corrected(
    path: LoadingPath, known: Sequence[Sequence[Level]], solve: Callable[[LoadingPath], list[list[Level]]]
) -> list[list[Level]]:
    """The path as corrections of the frictionless small-strain answer.

    Args:
        path: What was asked for.
        known: Small-strain grids of every target.
        solve: The path on three coarse grids.
    """
    flat = is_flat(path.indenter)
    wanted = list(path.targets)
    if flat and not path.friction:
        wanted = _resolved(wanted, [grids[-1].depth / (_SHALLOW * path.cover.thickness) for grids in known])
    stops = sorted(set(wanted))
    stopping = replace(path, targets=tuple(stops))
    deep, rest = solve(stopping.at_its_strain), solve(replace(stopping, friction=0.0, steepness=_REST))
    out: list[list[Level]] = []
    for target, stop, grids in zip(path.targets, wanted, known, strict=True):
        at = stops.index(stop)
        exact: Level = grids[-1]
        if flat:
            exact = ExtrapolatedLevel(levels=grids, sizes=press_linear.sizes(path.indenter))
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
#: Factor on heights and targets that leaves no strain to speak of [-].
_REST = 1e-3


def _on_grids(path: LoadingPath, progress: Callable[[str], None] | None) -> list[list[Level]]:
    around = path.indenter.axisymmetric
    grids = GRIDS if around else SOLID_GRIDS
    inputs = {"path": path, "grids": grids, "fillet": fillet(path.cover, path.indenter)}
    solve, read = (_around_axis, _radial) if around else (_in_space, _plane)
    data = store.fetch("finite-press", inputs, lambda: solve(path, progress))
    return [[read(data, path, n, i) for n in grids] for i in range(len(path.targets))]


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
    size = fillet(cover, indenter) * 1e3
    if is_flat(indenter):
        return {"edge": f"sharp at small strain, rounded with {size:.3g} mm for what finite strain or friction adds"}
    return {} if indenter.axisymmetric else {"surface": f"facets and edges rounded over {size:.3g} mm"}


def fillet(cover: Cover, indenter: Indenter) -> float:
    """Radius of the rounding of sharp edges, as small as the mesh around it can resolve [m]."""
    return min(cover.thickness, *indenter.footprint) / (20 if indenter.axisymmetric else 5)


def _around_axis(path: LoadingPath, progress: Callable[[str], None] | None) -> dict[str, Any]:
    cover, indenter = path.cover, path.indenter
    radius = _contact_radius(cover, indenter, path.targets[-1], path.control)
    reach = 12 * decay_length(cover) + 1.5 * radius
    out: dict[str, Any] = {}
    coarse = None
    for n in GRIDS:
        states, coarse = press_axisymmetric(
            cover,
            indenter,
            path.scaled,
            control=path.control,
            elements_per_thickness=n,
            contact_radius=radius,
            fillet=fillet(cover, indenter),
            reach=reach,
            steepness=path.steepness,
            friction=path.friction,
            coarse=coarse,
            progress=None if progress is None else with_grid(progress, n),
        )
        for i, state in enumerate(states):
            for name, values in closed(state.base, reach).items():
                out[f"{name}_{n}_{i}"] = values
            out[f"scalars_{n}_{i}"] = np.array([state.load, state.depth, state.area, state.overlap])
    return out


def _in_space(path: LoadingPath, progress: Callable[[str], None] | None) -> dict[str, Any]:
    cover, indenter = path.cover, path.indenter
    out: dict[str, Any] = {}
    coarse = None
    for n in SOLID_GRIDS:
        states, coarse = press_solid(
            cover,
            indenter,
            path.scaled,
            control=path.control,
            elements_per_thickness=n,
            contact_half=_contact_half(cover, indenter, path.targets[-1], path.control),
            fillet=fillet(cover, indenter),
            reach=7 * decay_length(cover),
            steepness=path.steepness,
            friction=path.friction,
            coarse=coarse,
            progress=None if progress is None else with_grid(progress, n),
        )
        for i, state in enumerate(states):
            out |= {f"x_{n}_{i}": state.x, f"y_{n}_{i}": state.y, f"pressure_{n}_{i}": state.pressure}
            out[f"scalars_{n}_{i}"] = np.array([state.load, state.depth, state.area, state.overlap])
    return out


def _contact_half(
    cover: Cover, indenter: Indenter, target: float, control: Literal["load", "depth"]
) -> tuple[float, float]:
    """Half widths of the small-strain contact, or of a flat shape, which a mesh is laid out for [m]."""
    if is_flat(indenter):
        return indenter.footprint
    surface = press_linear.levels(cover, indenter, [target], control, None)[0][0].surface
    return (float(np.abs(surface[:, 0]).max()), float(np.abs(surface[:, 1]).max()))


def with_grid(progress: Callable[[str], None], n: int) -> Callable[[str], None]:
    """`progress` with the grid named first."""
    return lambda text: progress(f"{n} elements through the cover: {text}")


def _contact_radius(cover: Cover, indenter: Indenter, target: float, control: Literal["load", "depth"]) -> float:
    """Contact radius of the small-strain solution, which a mesh is laid out for [m]."""
    if is_flat(indenter):
        return max(indenter.footprint)
    surface = press_linear.levels(cover, indenter, [target], control, None)[0][0].surface
    return float(np.hypot(surface[:, 0], surface[:, 1]).max())


def _radial(data: dict[str, Any], path: LoadingPath, n: int, i: int) -> Level:
    load, depth, area, _ = (float(value) for value in data[f"scalars_{n}_{i}"])
    spread = PointSpread(
        radius=data[f"radius_{n}_{i}"],
        pressure_per_force=data[f"pressure_{n}_{i}"] / load,
        reaction=float(data[f"reaction_{n}_{i}"]) / load,
        thickness=path.cover.thickness,
    )
    return RadialLevel(total_force=load / path.steepness, depth=depth / path.steepness, area=area, spread=spread)


def _plane(data: dict[str, Any], path: LoadingPath, n: int, i: int) -> Level:
    load, depth, area, _ = (float(value) for value in data[f"scalars_{n}_{i}"])
    return PlaneLevel(
        total_force=load / path.steepness,
        depth=depth / path.steepness,
        area=area,
        half=path.indenter.footprint,
        x=data[f"x_{n}_{i}"],
        y=data[f"y_{n}_{i}"],
        pressure=data[f"pressure_{n}_{i}"] / path.steepness,
    )
