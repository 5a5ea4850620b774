"""The reference of a case: its indentation by finite elements, also as one load of a loading path."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshes import Cover, SolidCover, TexelArray
from validation.campaign.case import Case
from validation.errors import InputError

if TYPE_CHECKING:
    from fem_reference.indentation.result import Indentation


def press_reference(cover: Cover | SolidCover, array: TexelArray, case: Case, *, friction: float = 0.0) -> Indentation:
    """Compute one case by finite elements.

    A load of a path is computed together with the other loads, because slip depends on the previous loads.

    Args:
        cover: The cover.
        array: The array.
        case: The indentation.
        friction: Coulomb friction coefficient between indenter and cover, inf for no slip [-].

    Raises:
        ValueError: If the indenter would pierce the cover, or the case does not fit the cover.
        InputError: If the solver of this kind of cover does not support the friction.
        ConvergenceError: If the solver does not converge.
    """
    from fem_reference.errors import UnsupportedError
    from fem_reference.indentation.press import press_path

    loads = case.path or (case.load,)
    try:
        results = press_path(cover, array, case.indenter, loads=loads, pose=case.pose, friction=friction)
    except UnsupportedError as error:
        if error.argument != "friction":
            raise
        raise InputError(f"contact.friction: {error}") from None
    return results[loads.index(case.load)]


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
