"""Press a rigid indenter into a cover: texel forces, and the error of each number.

A cover of `linear-elastic` layers is solved for small strain, one with any stored energy for finite strain; the
result says which.  Either way the answer comes from three grids, and their spread is the error estimate.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
import numpy.typing as npt

from fem_reference.finite_strain.newton import OVERLAP
from fem_reference.grid_convergence import extrapolated, grid_convergence
from fem_reference.indentation import finite_cover, finite_strain, small_strain
from fem_reference.indentation.grid_solution import Level
from fem_reference.small_strain_contact.frictionless import is_flat
from meshes import Cover, Indenter, TexelArray
from meshes.pose import Place, Pose

FloatArray = npt.NDArray[np.float64]

#: Factor on the change between two extrapolations (ASME V&V 20-2009 uses 1.25 on three grids).
_SAFETY = 1.25
#: Depth over thickness up to which small strain is taken to hold; for balls both agree to 0.3 % there [-].
_SMALL_STRAIN = 0.3


@dataclass(frozen=True, kw_only=True, eq=False)
class Indentation:
    """One indentation, as the reference sees it.

    Attributes:
        texel_forces: Normal force on each texel, shape (n,) [N].
        outside: Force that no active texel feels [N].
        total_force: Force of the indenter [N].
        depth: Approach from first touch of the undeformed cover [m].
        contact_area: Area that touches [m2].
        contact: The touching cells: columns x, y in the array's frame [m] and force [N], shape (m, 3).
        error_estimate: Estimated relative errors: `total_force` (at this depth), `peak_texel`, `contact_area`.
        assumptions: What the solution rests on: `strain`, `friction`, `base`.
        seconds: Wall time, near zero when it came from the store [s].
    """

    texel_forces: FloatArray
    outside: float
    total_force: float
    depth: float
    contact_area: float
    contact: FloatArray
    error_estimate: dict[str, float]
    assumptions: dict[str, str]
    seconds: float


def press(
    cover: Cover,
    array: TexelArray,
    indenter: Indenter,
    *,
    load: float | None = None,
    depth: float | None = None,
    at: tuple[float, float] = (0.0, 0.0),
    yaw: float = 0.0,
    friction: float = 0.0,
    progress: Callable[[str], None] | None = None,
) -> Indentation:
    """Press a guided, rigid indenter into a cover.

    On a laterally wide cover the contact does not depend on where the indenter stands or how it is turned, so poses
    share one stored solution.  On a cover of limited size every pose is solved; an indenter may hang over the side
    edges, and touches the top only.

    Args:
        cover: The cover; small strain when every layer is `linear-elastic`, finite strain otherwise.
        array: The texels under it.
        indenter: The shape.
        load: Force along the array's normal [N]; or
        depth: Approach from first touch [m].  Exactly one of the two.
        at: Where the indenter's axis stands in the array's frame [m].
        yaw: Turn about that axis [rad].
        friction: Coefficient of Coulomb's law between indenter and cover, inf for no slip.  Slip depends on the way, so
            such a path is walked in small steps: it takes longer [-].
        progress: Called with a line of text before each solve.

    Raises:
        ValueError: If not exactly one of load and depth is given, it is not positive, the indenter would reach
            through the cover, or its axis does not stand over it.
        ConvergenceError: If the contact does not converge.
    """
    return press_path(
        cover,
        array,
        indenter,
        loads=None if load is None else [load],
        depths=None if depth is None else [depth],
        at=at,
        yaw=yaw,
        friction=friction,
        progress=progress,
    )[0]


def press_path(
    cover: Cover,
    array: TexelArray,
    indenter: Indenter,
    *,
    loads: Sequence[float] | None = None,
    depths: Sequence[float] | None = None,
    at: tuple[float, float] = (0.0, 0.0),
    yaw: float = 0.0,
    friction: float = 0.0,
    progress: Callable[[str], None] | None = None,
) -> list[Indentation]:
    """`press` at several ascending loads or depths that share one loading path.

    Args:
        cover: As for `press`.
        array: As for `press`.
        indenter: As for `press`.
        loads: Forces, ascending [N]; or
        depths: Approaches, ascending [m].  Exactly one of the two.
        at: As for `press` [m].
        yaw: As for `press` [rad].
        friction: As for `press` [-].
        progress: As for `press`.

    Raises:
        ValueError: As for `press`.
        ConvergenceError: As for `press`.
    """
    targets, control = _targets(cover, loads, depths)
    place = Place(array=array, pose=Pose(at=at, yaw=yaw))
    _refuse_beside(cover, place.pose)
    _check_friction(friction)
    started = time.perf_counter()
    linear = cover.small_strain_only and not friction
    solver = small_strain if linear else finite_strain if cover.size is None else finite_cover
    found: Sequence[Sequence[Level]]
    if linear:
        found = small_strain.levels(cover, indenter, targets, control, progress, place=place)
    elif cover.size is not None:
        found = finite_cover.levels(cover, indenter, targets, control, progress, place=place, friction=friction)
    else:
        found = finite_strain.levels(cover, indenter, targets, control, progress, friction=friction)
    for levels in found:
        _refuse_piercing(cover, levels[-1].depth)
    common = partial(
        _indentation,
        sizes=solver.sizes(indenter),
        place=place,
        sharp=linear and is_flat(indenter),
        # What friction changes is no smoother than the pressure under an edge.
        least=1.0 if friction else solver.least_order(indenter),
        seconds=(time.perf_counter() - started) / len(targets),
        # An overlap that contact does not work off is not told from none.
        least_overlap=0.0 if linear else OVERLAP,
        spread_error=small_strain.base_error(cover, place) if linear else 0.0,
    )
    said = _assumptions(cover, friction) | solver.assumptions(cover, indenter)
    return [common(levels=levels, assumptions=said | _range(cover, levels[-1].depth)) for levels in found]


#: Share of a force over the share of the depth that contact leaves as overlap: forces grow up to its square [-].
_CONTACT = 2.0


def _assumptions(cover: Cover, friction: float) -> dict[str, str]:
    """What every result says of itself."""
    return {
        "strain": "small" if cover.small_strain_only else "finite",
        "friction": _friction(friction),
        "base": cover.base,
        **_sides(cover),
    }


def _range(cover: Cover, depth: float) -> dict[str, str]:
    """What a result says that is indented deeper than small strain is meant for."""
    share = depth / cover.thickness
    if not cover.small_strain_only or share <= _SMALL_STRAIN:
        return {}
    return {"range": f"indented to {share:.0%} of the thickness: more than small strain is meant for"}


def _indentation(
    *,
    levels: Sequence[Level],
    sizes: Sequence[float],
    place: Place,
    sharp: bool,
    least: float,
    assumptions: dict[str, str],
    seconds: float,
    least_overlap: float,
    spread_error: float,
) -> Indentation:
    """Put three grids together for one pose."""
    started = time.perf_counter()
    every = [level.texel_forces(place.array, place.pose.at, place.pose.yaw) for level in levels]
    forces = np.array([_value(each, sizes, sharp=sharp) for each in zip(*every, strict=True)])
    peak = int(np.argmax(np.abs(forces)))
    total = _value([level.total_force for level in levels], sizes, sharp=sharp)
    estimate = partial(_uncertainty, sizes=sizes, sharp=sharp, least=least)
    overlap = _CONTACT * max(levels[-1].overlap, least_overlap)
    return Indentation(
        texel_forces=forces,
        outside=total - float(forces.sum()),
        total_force=total,
        depth=_value([level.depth for level in levels], sizes, sharp=sharp),
        contact_area=levels[-1].area,
        contact=_placed(levels[-1].surface, place.pose),
        error_estimate={
            "total_force": estimate([each.total_force / each.depth for each in levels]) + overlap,
            "peak_texel": estimate([float(each[peak]) for each in every]) + spread_error + overlap,
            "contact_area": estimate([each.area for each in levels]),
        },
        assumptions=assumptions,
        seconds=seconds + time.perf_counter() - started,
    )


def _targets(
    cover: Cover, loads: Sequence[float] | None, depths: Sequence[float] | None
) -> tuple[list[float], Literal["load", "depth"]]:
    """Checked targets, and which of the two they are."""
    if (loads is None) == (depths is None):
        raise ValueError("give either a load or a depth, not both")
    name: Literal["load", "depth"] = "load" if depths is None else "depth"
    values = [float(value) for value in (loads if depths is None else depths) or []]
    if not values:
        raise ValueError(f"give at least one {name}")
    for value in values:
        if not np.isfinite(value) or value <= 0:
            raise ValueError(f"{name} must be positive, not {value}")
        if name == "depth":
            _refuse_piercing(cover, value)
    if values != sorted(values):
        raise ValueError(f"{name}s of one path must ascend, not {values}")
    return values, name


def _check_friction(friction: float) -> None:
    if not friction >= 0:
        raise ValueError(f"a friction coefficient is zero, positive or inf (no slip), not {friction}")


def _friction(coefficient: float) -> str:
    """What a result says of friction."""
    if coefficient == 0:
        return "frictionless"
    return f"Coulomb, coefficient {coefficient:g}" if np.isfinite(coefficient) else "no slip"


def _refuse_piercing(cover: Cover, depth: float) -> None:
    if depth >= cover.thickness:
        raise ValueError(
            f"the indenter would pierce the cover: depth {depth * 1e3:.3g} mm of {cover.thickness * 1e3:.3g} mm; "
            "use less load, a wider indenter or a stiffer cover"
        )


def _sides(cover: Cover) -> dict[str, str]:
    """What a result on a cover of limited size says of its sides."""
    if cover.size is None:
        return {}
    x, y = (1e3 * edge for edge in cover.size)
    return {"sides": f"free, {x:.4g} x {y:.4g} mm, touched on top only"}


def _refuse_beside(cover: Cover, pose: Pose) -> None:
    if cover.size is None or all(abs(a) <= edge / 2 for a, edge in zip(pose.at, cover.size, strict=True)):
        return
    x, y, width, height = (1e3 * value for value in (*pose.at, *cover.size))
    raise ValueError(
        f"the indenter's axis at ({x:.4g}, {y:.4g}) mm stands beside the cover, which measures {width:.4g} x "
        f"{height:.4g} mm around the array's middle"
    )


def _placed(surface: FloatArray, pose: Pose) -> FloatArray:
    """Points from the indenter's frame to the array's, shape (m, 3)."""
    x, y, force = surface.T
    return np.column_stack([*pose.placed(x, y), force])


def _value(values: Sequence[float], sizes: Sequence[float], *, sharp: bool) -> float:
    """The answer from three grids.

    Under a sharp edge the pressure is singular and the error falls as the cell size: extrapolate once (Richardson).
    Elsewhere the finest grid is the answer.
    """
    if not sharp:
        return float(values[-1])
    return float(extrapolated(values, sizes))


def _uncertainty(values: Sequence[float], sizes: Sequence[float], *, sharp: bool, least: float) -> float:
    """Estimated error of `_value`, relative: what extrapolating a grid earlier would change, or the usual index.

    The index also serves where the grids go back and forth and nothing is extrapolated.
    """
    answer = _value(values, sizes, sharp=sharp)
    if answer == 0:
        return 0.0
    if sharp and (values[1] - values[0]) * (values[2] - values[1]) >= 0:
        return _SAFETY * abs(answer - float(extrapolated(values[:2], sizes[:2]))) / abs(answer)
    return grid_convergence(values, sizes, least=least) / abs(answer)
