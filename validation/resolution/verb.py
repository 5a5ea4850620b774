"""The verbs `limits`, `locate` and `design`: read the options, compute, and draw."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from meshes.hardness import SCALES
from validation.api import describe
from validation.errors import Faults, InputError, refuse_existing
from validation.extras import REPORT_MODULES, require
from validation.output_folder import check_writable, optional_folder
from validation.sensor_file import SensorDescription
from validation.text.hardness import read_hardness
from validation.text.quantity import format_time, read_positive, read_quantity

if TYPE_CHECKING:
    import numpy.typing as npt

    from validation.resolution.design import Designs
    from validation.resolution.limits import Limits
    from validation.resolution.locate import Located

#: Number of values from one to another where no count is given.
_STEPS = 11
#: Smallest and largest thickness and pitch [m].
_THINNEST, _THICKEST = 1e-5, 0.1
#: Tolerance of a hardness, in its units.
_TOLERANCE = 5.0
#: Largest number of designs, and about the time of each [s].
_MOST_DESIGNS, _SECONDS = 5000, 0.05
#: Largest radius and distance of touches, over the pitch [-], and largest load of one [N].
_FARTHEST, _HEAVIEST = 20.0, 1e4
#: Largest number of touches that are looked for [-].
_MOST_TOUCHES = 4


def limits(
    sensor: SensorDescription | str | Path,
    *,
    load: str = "1 N",
    noise: str | None = None,
    two: str | None = None,
    radius: str = "0 mm",
    thicknesses: str | None = None,
    prior: Literal["around", "between"] = "around",
    picture: str | Path | None = None,
    progress: Callable[[str], None] | None = None,
) -> Limits:
    """Compute the smallest errors of place, force, radius and separation, and the least force that a sensor detects.

    Args:
        sensor: Sensor, as a sensor file or the name of a built-in sensor.
        load: Force of a touch.
        noise: Standard deviation of the noise of a texel's force; that of the sensor, or one count, when not given.
        two: Distance of two touches whose separation is told; None for one touch.
        radius: Radius of a touch, `0 mm` for a point.
        thicknesses: Least and largest thickness of a curve over the thickness of a flat cover, such as `1mm:6mm`.
        prior: Where a touch may be: within a pitch `around` the middle texel, or in the cell `between` it and the next
            ones.
        picture: File for the error of place above every texel, .png or .svg; None to compute no map.
        progress: Called with a line of text before each step.

    Raises:
        InputError: If an option cannot be read, or the counts of the sensor fall while the force rises.
        MissingExtraError: If finite elements or the drawing are needed and not installed.
        ConvergenceError: If finite elements are needed and did not converge.
    """
    description, target = describe(sensor), None if picture is None else Path(picture)
    options = read_limits(description, load=load, noise=noise, two=two, radius=radius, thicknesses=thicknesses)
    _check_picture(target)
    refuse_existing("--picture", target)
    check_writable(target)
    require("skfem", useful=("matplotlib",) if target else ())
    from validation.resolution.limits import find_limits
    from validation.resolution.picture import draw_map

    found = find_limits(description, **options, prior=prior, over_array=target is not None, progress=progress)
    if target is not None:
        draw_map(found, description.array, target)
    return found


def locate(
    sensor: SensorDescription | str | Path,
    frames: npt.ArrayLike | str | Path,
    *,
    touches: int = 1,
    radius: str | None = None,
    noise: str | None = None,
    forces: bool = False,
    array: int | None = None,
    topic: str | None = None,
    out: str | Path | None = None,
    picture: str | Path | None = None,
    progress: Callable[[str], None] | None = None,
) -> Located:
    """Find the places, forces and radius of touches in frames, with intervals that hold 95 %.

    Args:
        sensor: Sensor, as a sensor file or the name of a built-in sensor.
        frames: A recording; or the counts of n texels, shape (n,) or (frames, n) [-].
        touches: Number of touches to look for in each frame, 1 to 4.
        radius: Radius of the touches, or a range such as `0mm:2mm`; 0 to one pitch when not given.
        noise: Standard deviation of the noise of a texel's force; that of the sensor, or one count, when not given.
        forces: Whether the array `frames` holds forces [N], and not counts.
        array: Index of the array if a recording has several; the one that is pressed most when not given.
        topic: Topic that holds the frames, in bags of other programs.
        out: CSV file with one row for each touch; None to write none.
        picture: File for the brightest frame with its touches, .png or .svg; None to draw none.
        progress: Called with a line of text before each step.

    Raises:
        InputError: If an option or the frames cannot be read, or the counts of the sensor fall while the force rises.
        RecordingError: If the recording cannot be read.
        MissingExtraError: If finite elements or the drawing are needed and not installed.
        ConvergenceError: If finite elements are needed and did not converge.
    """
    description, faults = describe(sensor), Faults()
    far = _find_farthest(description)
    if not 1 <= touches <= _MOST_TOUCHES:
        faults.append(f"--touches: accepted: 1..{_MOST_TOUCHES}, not {touches}")
    level = noise and faults.read(read_positive, noise, "force", _HEAVIEST, place="--noise")
    ends = tuple(
        faults.read(read_positive, each, "length", far, place="--radius", zero=True)
        for each in (radius.split(":", 1) if radius else ())
    )
    faults.refuse()
    if ends and ends[0] > ends[-1]:
        raise InputError(f"--radius: {radius!r} must not fall; write for example 0mm:2mm")
    targets = {"--out": Path(out) if out else None, "--picture": Path(picture) if picture else None}
    _check_picture(targets["--picture"])
    for option, target in targets.items():
        refuse_existing(option, target)
        check_writable(target)
    require("skfem", useful=("matplotlib",) if picture else ())
    from validation.resolution.frames import read_frames
    from validation.resolution.locate import locate_frames
    from validation.resolution.picture import draw_touches

    read = read_frames(description, frames, forces=forces, index=array, topic=topic)
    found = locate_frames(
        description, read, count=touches, noise=level or None, radii=(ends[0], ends[-1]) if ends else None,
        progress=progress,
    )  # fmt: skip
    if out:
        found.write(Path(out))
    if picture:
        draw_touches(found, description.array, read, Path(picture))
    return found


def _find_farthest(sensor: SensorDescription) -> float:
    """Return the largest radius and distance of touches, rounded to 1e-12 m so that its own text is accepted [m]."""
    return round(_FARTHEST * min(sensor.array.pitch), 12)


def _check_picture(target: Path | None) -> None:
    if target is not None and target.suffix not in {".png", ".svg"}:
        raise InputError(f"--picture: {target} is neither .png nor .svg; write for example --picture {target.stem}.png")


def read_limits(
    sensor: SensorDescription,
    *,
    load: str = "1 N",
    noise: str | None = None,
    two: str | None = None,
    radius: str = "0 mm",
    thicknesses: str | None = None,
) -> dict[str, Any]:
    """Read quantities of limits, to the arguments of `validation.resolution.limits.find_limits`.

    Raises:
        InputError: With one line per fault.
    """
    faults, far = Faults(), _find_farthest(sensor)
    found = {
        "load": faults.read(read_positive, load, "force", _HEAVIEST, place="--load"),
        "radius": faults.read(read_positive, radius, "length", far, place="--radius", zero=True),
        "noise": noise and faults.read(read_positive, noise, "force", _HEAVIEST, place="--noise"),
        "separation": two and faults.read(read_positive, two, "length", far, place="--two"),
        "thicknesses": thicknesses
        and faults.read(_read_lengths, thicknesses, place="--thicknesses", example="1mm:6mm"),
    }
    faults.refuse()
    span = found["thicknesses"]
    return found | {"thicknesses": span.values() if isinstance(span, _Span) else ()}


class _Span(NamedTuple):
    """Values at equal steps, both ends included."""

    low: float
    high: float
    steps: int

    def values(self) -> tuple[float, ...]:
        """List the values, without the rounding errors of the steps."""
        step = (self.high - self.low) / max(self.steps - 1, 1)
        return tuple(round(self.low + step * number, 12) for number in range(self.steps))


def _read_span(
    text: str, read: Callable[[str], float], *, place: str, example: str, within: str = "", single: bool = False
) -> _Span:
    """Read FROM:TO or FROM:TO:COUNT, where `single` also one value.

    Args:
        text: The text.
        read: Function that reads one end.
        place: Option that holds the text; error messages begin with it.
        example: Accepted text for error messages.
        within: Words of error messages for the ends that `read` accepts.
        single: Whether one value is accepted.
    """
    parts = text.split(":")
    if single and len(parts) == 1:
        only = read(text)
        return _Span(only, only, 1)
    count = parts[2] if len(parts) == 3 else str(_STEPS)  # noqa: PLR2004 -- from, to and count
    if len(parts) not in {2, 3} or not re.fullmatch(r"[0-9]{1,9}", count):
        raise InputError(f"{place}: {text!r} is not FROM:TO or FROM:TO:COUNT; write for example {example}")
    low, high = (read(each) for each in parts[:2])
    if not low < high or int(count) < 2:  # noqa: PLR2004 -- both ends
        raise InputError(f"{place}: {text!r} must rise{within}, in two steps or more; write for example {example}")
    return _Span(low, high, int(count))


def _read_lengths(text: str, *, place: str, example: str, single: bool = False) -> _Span:
    def read(end: str) -> float:
        number = read_quantity(end, "length", place=place, example=example)
        if not _THINNEST <= number <= _THICKEST:
            raise InputError(f"{place}: {end!r} must lie within 0.01mm:100mm; write for example {example}")
        return number

    return _read_span(text, read, place=place, example=example, within=", within 0.01mm:100mm", single=single)


def _read_softness(text: str, tolerance: float, *, place: str = "--hardness") -> tuple[_Span, str]:
    """Read hardnesses, and their scale; both ends must stay on the scale with the tolerance."""
    scales = []

    def read(end: str) -> float:
        found = read_hardness(end, place=place)
        low, high = SCALES[found.scale].range
        if not low <= found.hardness - tolerance <= found.hardness + tolerance <= high:
            raise InputError(
                f"{place}: {end!r} with its tolerance of {tolerance:g} leaves {low:g}..{high:g} "
                f"{SCALES[found.scale].name}, where the modulus is known; give others, or a smaller --tolerance"
            )
        scales.append(found.scale)
        return found.hardness

    span = _read_span(text, read, place=place, example="30A:60A", single=True)
    if len(set(scales)) > 1:
        raise InputError(f"{place}: {text!r} mixes two scales; write for example 30A:60A")
    return span, scales[0]


def design(
    sensor: SensorDescription | str | Path,
    *,
    thickness: str = "1mm:6mm",
    hardness: str | None = None,
    tolerance: float | None = None,
    pitch: str | None = None,
    load: str = "1 N",
    noise: str | None = None,
    radius: str | None = None,
    ball: str | None = None,
    out: str | Path | None = None,
    progress: Callable[[str], None] | None = None,
) -> Designs:
    """Compute what every thickness, hardness and pitch of a flat sensor tells, and the best design.

    Args:
        sensor: Sensor, as a sensor file or the name of a built-in sensor.
        thickness: Thicknesses of the cover: one, `FROM:TO` for eleven, or `FROM:TO:COUNT`, such as `1mm:5mm:9`.
        hardness: Hardnesses of the softest layer, such as `30A:60A:4`; the modulus of the sensor when not given.
        tolerance: Tolerance of the hardness, in its units; 5 when not given.
        pitch: Smaller pitches of the array, such as `2mm:5mm:4`; that of the sensor when not given.
        load: Force of a touch.
        noise: Standard deviation of the noise of a texel's force; that of the sensor, or one count, when not given.
        radius: Radius of a touch, `0 mm` for a point, which is the default.
        ball: Radius of a ball, from which the radius of the touch follows.
        out: Folder for the page with its pictures, and `design.json`.
        progress: Called with a line of text before each step.

    Raises:
        InputError: If an option cannot be read, there are too many designs, or the cover needs finite elements.
        MissingExtraError: If the page is wanted and the packages that draw it are missing.
    """
    description = describe(sensor)
    with optional_folder(out) as folder:
        require("skfem", *(REPORT_MODULES if out else ()))
        options = _read_design(
            description, thickness=thickness, hardness=hardness, tolerance=tolerance, pitch=pitch, load=load,
            noise=noise, radius=radius, ball=ball,
        )  # fmt: skip
        from validation.resolution.design import find_designs

        found = find_designs(description, **options, progress=progress)
        if folder is not None:
            from validation.resolution.design_page import write_designs

            write_designs(found, folder)
    return found


def _read_design(
    sensor: SensorDescription,
    *,
    thickness: str,
    hardness: str | None,
    tolerance: float | None,
    pitch: str | None,
    load: str,
    noise: str | None,
    radius: str | None,
    ball: str | None,
) -> dict[str, Any]:
    """Read quantities of designs, to the arguments of `validation.resolution.design.find_designs`.

    Raises:
        InputError: With one line per fault.
    """
    words = f"{sensor.source}: designs of a %s need finite elements; describe them in a file for softcover sweep"
    cover = sensor.require_layers(words % "curved cover")
    if cover.size is not None:
        raise InputError(words % "cover with free sides")
    if radius and ball:
        raise InputError("--radius, --ball: the radius of the touch follows from the ball; give one of them")
    if tolerance is not None and not (hardness and 0 <= tolerance < math.inf):
        raise InputError(f"--tolerance: is that of --hardness, and not negative; {tolerance:g} is given")
    tolerance = _TOLERANCE if tolerance is None else tolerance
    faults, far = Faults(), _find_farthest(sensor)
    soft = faults.read(_read_softness, hardness, tolerance) if hardness else None
    thick = faults.read(_read_lengths, thickness, place="--thickness", example="1mm:5mm", single=True)
    wide = faults.read(_read_lengths, pitch, place="--pitch", example="2mm:5mm", single=True) if pitch else None
    found = {
        "load": faults.read(read_positive, load, "force", _HEAVIEST, place="--load"),
        "noise": noise and faults.read(read_positive, noise, "force", _HEAVIEST, place="--noise"),
        "radius": faults.read(read_positive, radius, "length", far, place="--radius", zero=True) if radius else 0.0,
        "ball": ball and faults.read(read_positive, ball, "length", far, place="--ball"),
    }
    faults.refuse()
    counts = [each.steps if each else 1 for each in (thick, soft and soft[0], wide)]
    if (total := math.prod(counts)) > _MOST_DESIGNS:
        raise InputError(
            f"--thickness, --hardness, --pitch: {' x '.join(map(str, counts))} = {total} designs would take about "
            f"{format_time(_SECONDS * total)}; at most {_MOST_DESIGNS} are computed: give smaller counts, or describe "
            "them in a file for softcover sweep"
        )
    return found | {
        "cover": cover,
        "radius": None if ball else found["radius"],
        "thicknesses": thick.values(),
        "pitches": wide.values() if wide else (min(sensor.array.pitch),),
        "hardnesses": soft[0].values() if soft else (),
        "scale": soft[1] if soft else "",
        "tolerance": tolerance if soft else None,
    }
