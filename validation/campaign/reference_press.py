"""The reference of a case: its indentation by finite elements, also as one load of a loading path."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from fem_reference.errors import PiercedError, UnsupportedError
from meshes import Cover, SolidCover, TexelArray
from validation.campaign.case import Case
from validation.errors import InputError

if TYPE_CHECKING:
    from fem_reference.indentation.result import Indentation

#: Error estimates of several bodies that a reference states besides that of the force.
_ERRORS = ("depth", "peak_texel", "contact_area")


def press_reference(
    cover: Cover | SolidCover,
    array: TexelArray,
    case: Case,
    *,
    friction: float = 0.0,
    progress: Callable[[str], None] | None = None,
) -> Indentation:
    """Compute one case by finite elements.

    A load of a path is computed together with the other loads, because slip depends on the previous loads.

    Args:
        cover: The cover.
        array: The array.
        case: The indentation.
        friction: Coulomb friction coefficient between indenter and cover, inf for no slip [-].
        progress: Called with a line of text before each step.

    Raises:
        ValueError: If the indenter would pierce the cover, or the case does not fit the cover.
        InputError: If the solver of this kind of cover does not support the friction.
        ConvergenceError: If the solver does not converge.
    """
    from fem_reference.indentation.press import press_path

    if case.others:
        return _press_bodies(cover, array, case, friction)
    loads = case.path or (case.load,)
    with name_unsupported("contact.friction"):
        results = press_path(
            cover,
            array,
            case.indenter,
            loads=loads,
            pose=case.pose,
            friction=friction,
            superposed=True,
            as_far=False,
            progress=progress,
        )
    return results[loads.index(case.load)]


def _press_bodies(cover: Cover | SolidCover, array: TexelArray, case: Case, friction: float) -> Indentation:
    """Press all bodies of a case at once, guided and without friction.

    Raises:
        ValueError: If the cover is not wide and linear, the press has friction, bodies overlap, or one would pierce the
            cover or is lifted by the others.
    """
    from fem_reference import result_store
    from fem_reference.indentation.layered import state_assumptions
    from fem_reference.indentation.result import Indentation, warn_of_errors
    from fem_reference.small_strain_contact.several_indenters import Body, press_together

    if not isinstance(cover, Cover) or cover.size is not None or not cover.small_strain_only or friction:
        raise ValueError(
            "several bodies are pressed on wide covers of linear-elastic layers without friction; split them"
        )
    bodies = [Body(indenter=each.indenter, load=each.load, at=each.pose.at, yaw=each.pose.yaw) for each in case.bodies]
    inputs = {
        "cover": cover,
        "bodies": bodies,
        "centres": array.centres,
        "active": array.active,
        "size": array.texel_size,
    }
    started = time.perf_counter()
    found = result_store.fetch("together", inputs, lambda: press_together(cover, array, bodies))
    assumptions: dict[str, str] = {}
    for depth, body in sorted(zip(found.depths.tolist(), case.bodies, strict=True), key=lambda each: each[0]):
        which = f"the body of {body.load:.4g} N at {body.place}"
        if depth >= cover.thickness:
            raise PiercedError(
                f"{which} would pierce the cover ({1e3 * depth:.3g} mm deep, the cover has "
                f"{1e3 * cover.thickness:.4g} mm); use a smaller load, a wider body or a stiffer cover",
                "load",
            )
        if depth <= 0:
            raise ValueError(
                f"{which} is lifted by {-1e3 * depth:.3g} mm by the cover that the others displace; "
                "use loads that differ less, or bodies farther apart"
            )
        assumptions |= state_assumptions(cover, body.indenter, depth)
    errors = {"total_force": 0.0, **{key: found.error_estimate[key] for key in _ERRORS}}
    points = np.column_stack([found.contact[:, :2], np.full(len(found.contact), cover.thickness)])
    pushes = np.column_stack([np.zeros((len(points), 2)), -found.contact[:, 2]])
    force = np.array([0.0, 0.0, -case.load])
    measured = float(found.texel_forces.sum())
    return Indentation(
        texel_forces=found.texel_forces, outside=found.outside, texel_errors=found.texel_errors,
        outside_error=found.outside_error, total_force=case.load, force=force, base_force=force,
        moment=np.cross(points, pushes).sum(axis=0), unmeasured=np.array([0.0, 0.0, measured - case.load]),
        balance=(measured + found.outside) / case.load - 1, depth=float(found.depths.max()),
        contact_area=found.contact_area, contact_points=points, contact_forces=pushes,
        error_estimate=errors, assumptions=assumptions, warnings=warn_of_errors(errors),
        seconds=time.perf_counter() - started,
    )  # fmt: skip


@contextlib.contextmanager
def name_unsupported(friction: str, others: str | None = None) -> Iterator[None]:
    """Turn the `UnsupportedError` of a solver into an `InputError` that names the user's option or key.

    Args:
        friction: Option, or key of the sensor file, that states the friction.
        others: Text before the name of any other argument, such as `--`; if None, errors on them are raised unchanged.

    Raises:
        InputError: If the solver does not support an argument that a user states.
    """
    try:
        yield
    except UnsupportedError as error:
        if error.argument != "friction" and others is None:
            raise
        place = friction if error.argument == "friction" else f"{others}{error.argument}"
        raise InputError(f"{place}: {error}") from None


def find_stored_reference(
    cover: Cover | SolidCover, array: TexelArray, case: Case, *, friction: float = 0.0
) -> Indentation | None:
    """Return the reference of a case if all its solutions are in the result store; None if one is missing.

    The result is also None for a case that the solver refuses, except for its friction, which concerns all cases.

    Raises:
        InputError: If the solver of this kind of cover does not support the friction.
    """
    from fem_reference import ConvergenceError
    from fem_reference.result_store import NotStoredError, stored_only

    try:
        with stored_only():
            return press_reference(cover, array, case, friction=friction)
    except InputError:
        raise
    except (NotStoredError, ValueError, ConvergenceError):
        return None
