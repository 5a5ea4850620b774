"""Press a rigid indenter into a cover and compute the texel forces with error estimates.

Each kind of cover has its own solver. `solve_press` chooses it by the type of the cover.  A solver for another kind of
cover is registered with `solve_press.register`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import singledispatch
from typing import Literal

import numpy as np

from fem_reference.finite_strain.loading_path import Control
from fem_reference.indentation.result import STRAINS, Indentation, PressProblem
from meshes import Cover, Indenter, Pose, SolidCover, TexelArray

#: Pose of an indenter above the middle of a flat array that moves along -z.
FLAT = Pose()


@singledispatch
def solve_press(cover: object, problem: PressProblem) -> list[Indentation]:
    """Solve a press by the solver of the cover's type.

    Args:
        cover: The cover.
        problem: Array, indenter, pose, targets and further settings.

    Returns:
        One result per target.

    Raises:
        TypeError: If no solver is registered for the type.
        UnsupportedError: If the solver does not support the problem.
    """
    del problem
    raise TypeError(f"no solver is registered for a cover of type {type(cover).__name__}")


@solve_press.register
def _(cover: Cover, problem: PressProblem) -> list[Indentation]:
    from fem_reference.indentation.layered import press_layers

    return press_layers(cover, problem)


@solve_press.register
def _(cover: SolidCover, problem: PressProblem) -> list[Indentation]:
    from fem_reference.curved_cover.press import press_solid

    return press_solid(cover, problem)


def press(
    cover: object,
    array: TexelArray,
    indenter: Indenter,
    pose: Pose = FLAT,
    *,
    load: float | None = None,
    depth: float | None = None,
    friction: float = 0.0,
    strain: Literal["small", "finite"] | None = None,
    accuracy: float | None = None,
    fields: bool = False,
    progress: Callable[[str], None] | None = None,
) -> Indentation:
    """Press a rigid indenter, guided along its direction of motion, into a cover.

    Args:
        cover: `Cover`, solved at small strain if every layer is `linear-elastic`, else at finite strain; `SolidCover`;
            or any cover for whose type a solver is registered with `solve_press`.
        array: Array with the texels under the cover.
        indenter: Indenter with its shape.
        pose: Position of first touch, direction of motion, yaw and tilt.  Layers are pressed along -z, with a tilt of
            at most 10 degrees about either axis; the depth is measured from first touch.
        load: Force along the motion [N].  Give either `load` or `depth`.
        depth: Approach of the indenter from first touch [m].
        friction: Coefficient of Coulomb friction between indenter and cover, inf for no slip [-].  Slip depends on the
            loading history, so that problems with friction are solved in small steps and take longer.
        strain: Kind of strain in a solid: `small` or None for small strain, `finite` for finite strain.  For layers it
            follows from their materials.
        accuracy: Wanted relative error [-].  Finer grids are added until all estimated errors are below it.  A result
            that does not reach it has a warning with the reason.  None for the usual three grids.
        fields: Whether the result has displacement and stress in the cover.  Such results have their own entries in the
            store.
        progress: Called with a line of text before each solve.

    Returns:
        Forces, depth, contact area and their error estimates.

    Raises:
        ValueError: If not exactly one of load and depth is given, it is not positive, or the indenter misses the cover.
        UnsupportedError: If the solver of this kind of cover does not support the request.
        PiercedError: If the indenter would pierce the cover.
        ConvergenceError: If the solver does not converge.  An `IncompletePathError` has the results that were reached.
    """
    return press_path(
        cover,
        array,
        indenter,
        pose,
        loads=None if load is None else [load],
        depths=None if depth is None else [depth],
        friction=friction,
        strain=strain,
        accuracy=accuracy,
        fields=fields,
        progress=progress,
    )[0]


def press_path(
    cover: object,
    array: TexelArray,
    indenter: Indenter,
    pose: Pose = FLAT,
    *,
    loads: Sequence[float] | None = None,
    depths: Sequence[float] | None = None,
    friction: float = 0.0,
    strain: Literal["small", "finite"] | None = None,
    accuracy: float | None = None,
    fields: bool = False,
    superposed: bool = False,
    as_far: bool = True,
    progress: Callable[[str], None] | None = None,
) -> list[Indentation]:
    """Press a rigid indenter into a cover at several ascending loads or depths, one after the other; see `press`.

    Unloading is not computed.  Without friction it retraces the path of loading; with friction it does not.

    Args:
        cover: Cover, as for `press`.
        array: Array with the texels under the cover.
        indenter: Indenter with its shape.
        pose: Pose of the indenter, as for `press`.
        loads: Ascending forces along the motion [N].  Give either `loads` or `depths`.
        depths: Ascending approaches of the indenter from first touch [m].
        friction: Coefficient of Coulomb friction between indenter and cover, inf for no slip [-].
        strain: Kind of strain, as for `press`.
        accuracy: Wanted relative error, as for `press` [-].
        fields: Whether the results have displacement and stress in the cover.
        superposed: Whether finite strain and the sides of layers of limited size are solved apart and added, in seconds
            instead of minutes.  What they change together is missing, and its estimate is part of all errors.
        as_far: Whether a path through layers that stops early is solved again as far as all grids reach.  Without, its
            error has no results; finer grids are tried in both cases.
        progress: Called with a line of text before each solve.

    Returns:
        One result per load or depth, in the same order.

    Raises:
        ValueError: As for `press`, or if loads or depths descend.
        ConvergenceError: As for `press`.
    """
    if (loads is None) == (depths is None):
        raise ValueError("give either a load or a depth, not both")
    control: Control = "load" if depths is None else "depth"
    targets = tuple(float(value) for value in (loads if depths is None else depths) or ())
    if not targets:
        raise ValueError(f"give at least one {control}")
    for value in targets:
        if not np.isfinite(value) or value <= 0:
            raise ValueError(f"{control} must be positive, not {value}")
    if list(targets) != sorted(targets):
        raise ValueError(f"{control}s of one path must ascend, because unloading is not computed: {list(targets)}")
    if not friction >= 0:
        raise ValueError(f"a friction coefficient is zero, positive or inf (no slip), not {friction}")
    if accuracy is not None and not 0 < accuracy < 1:
        raise ValueError(f"an accuracy is a relative error between 0 and 1, such as 0.01, not {accuracy}")
    if strain not in {None, *STRAINS}:
        raise ValueError(f"strains are {' or '.join(STRAINS)}, not {strain!r}")
    problem = PressProblem(
        array=array, indenter=indenter, pose=pose, targets=targets, control=control,
        friction=friction, strain=strain, accuracy=accuracy, fields=fields, superposed=superposed, as_far=as_far,
        progress=progress,
    )  # fmt: skip
    return solve_press(cover, problem)
