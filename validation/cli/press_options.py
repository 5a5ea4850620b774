"""Reading of the options of `softcover press`: models, force, friction, accuracy, position and files."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from validation.errors import InputError, nearest
from validation.text.friction import read_friction

if TYPE_CHECKING:
    from meshes import TexelArray

#: Option `--strain`.
Strain = Annotated[
    str | None,
    Parameter(
        help="On curved covers: small (seconds), or finite (minutes; large depths, the material as it is). Flat covers "
        "follow their materials."
    ),
]

#: Largest number of points of a curve [-].
_MOST_POINTS = 1000


def read_accuracy(text: str | None, *, used: bool) -> float | None:
    """Parse the option `--accuracy`, a share such as 1% or 0.01; None if it is not given [-].

    Raises:
        InputError: If the text is not a share, or if no finite elements are computed.
    """
    if text is None:
        return None
    number, percent = text.strip().removesuffix("%"), text.strip().endswith("%")
    try:
        value = float(number) / (100 if percent else 1)
    except ValueError:
        value = math.nan
    if not 0 < value < 1:
        raise InputError(f"--accuracy: {text!r} is not a share between 0 and 1; for example --accuracy 1%")
    if not used:
        raise InputError("--accuracy: the fast model has none; leave it out, or let --model name fem")
    return value


def check_position(array: TexelArray, position: tuple[float, float]) -> None:
    """Refuse a position of the indenter's axis beside the array.

    Args:
        array: The array.
        position: Position (x, y) of the axis in the array's frame [m].

    Raises:
        InputError: If the position is beside the array; the message states the accepted ranges.
    """
    half = [size / 2 for size in array.texel_size]
    low = [float(array.centres[:, axis].min()) - half[axis] for axis in (0, 1)]
    high = [float(array.centres[:, axis].max()) + half[axis] for axis in (0, 1)]
    if not all(low[axis] <= position[axis] <= high[axis] for axis in (0, 1)):
        x, y = (f"{1e3 * low[axis]:.4g}..{1e3 * high[axis]:.4g} mm" for axis in (0, 1))
        given = f"({1e3 * position[0]:.4g}, {1e3 * position[1]:.4g}) mm"
        raise InputError(f"--at: {given} is not on the array; accepted: x {x}, y {y}")


def check_files(curve: int | None, out: Path | None, models: tuple[str, ...] | None) -> None:
    """Refuse `--curve` and `--out` where they have nothing to write.

    Raises:
        InputError: If the finite elements are not chosen, a curve has no folder, or its number of points is wrong.
    """
    if (out is not None or curve is not None) and models is not None and "fem" not in models:
        raise InputError("--out, --curve: the files hold results of the finite elements; let --model name fem")
    if curve is not None and not 1 <= curve <= _MOST_POINTS:
        raise InputError(f"--curve: accepted: 1..{_MOST_POINTS} points, not {curve}")
    if curve is not None and out is None:
        raise InputError("--curve: give the folder for the curve, for example --out curve")


def read_models(text: str) -> tuple[str, ...]:
    """Parse the option `--model`, names of models joined by commas.

    Raises:
        InputError: If a name is unknown.
    """
    from validation.campaign.comparison import MODELS

    names = tuple(name.strip() for name in text.split(","))
    unknown = [f"--model: unknown model {name!r}; {nearest(name, MODELS)}" for name in names if name not in MODELS]
    if unknown:
        raise InputError(*unknown)
    return names


def read_friction_option(text: str | None, *, used: bool) -> float | None:
    """Parse the friction coefficient between indenter and cover; infinite for `no-slip` [-].

    Args:
        text: Value of the option `--friction`, None if it is not given.
        used: Whether finite elements are computed; the fast model has no friction.

    Raises:
        InputError: If the text is not a coefficient, or the coefficient is not zero and no finite elements are
            computed.
    """
    if text is None:
        return None
    value = read_friction(text, place="--friction", example="--friction 0.4")
    if value and not used:
        raise InputError("--friction: the fast model has none; leave it out, or let --model name fem")
    return value


def read_force(load: str | None, depth: str | None) -> tuple[float | None, float | None]:
    """Parse the options `--load` and `--depth`, of which exactly one must be given.

    Returns:
        The load [N] and the depth [m], one of which is None.

    Raises:
        InputError: If both options or none are given, or the given one cannot be read.
    """
    from validation.text.indenter import read_depth, read_load

    if load is not None and depth is None:
        return read_load(load), None
    if depth is not None and load is None:
        return None, read_depth(depth)
    raise InputError("--load, --depth: give one of them, for example --load 4.9N or --depth 0.3mm")
