"""One press from options as text, on the command line and in Python: reading of the options, and computation."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any, Literal, cast

from meshes import Indenter
from validation.campaign import comparison
from validation.campaign.case import Case
from validation.campaign.reference_press import name_unsupported
from validation.errors import Faults, InputError, check_choice
from validation.parameters import find_parameters
from validation.places import FlatPlaces, Places, PoseText, find_places
from validation.sensor_file import BUILT_IN, SensorDescription
from validation.text.friction import read_friction
from validation.text.indenter import read_depth, read_indenter, read_load, read_yaw

if TYPE_CHECKING:
    from fastmodel import Parameters
    from fem_reference.indentation.result import Indentation
    from validation.press_files import LoadCurve

#: Kinds of strain of the finite elements that a user can name.
STRAINS = ("small", "finite")
#: Largest accepted number of points of a curve of load over depth [-].
_MOST_POINTS = 1000

Progress = Callable[[str], None]


@dataclass(frozen=True, kw_only=True)
class PressRequest:
    """A press that a user requests: sensor, indenter, pose, load or depth, and models.

    Attributes:
        sensor: Description of the sensor, or parameters of its fast model.
        indenter: The indenter.
        shape: The indenter as text.
        pose: Place, direction and rotations of the indenter.
        load: Force along the motion [N]; None if the depth is given.
        depth: Approach of the indenter from first touch [m]; None if the load is given.
        friction: Coefficient of Coulomb friction, inf for no slip; that of the sensor if None [-].
        strain: Kind of strain, `small` or `finite`; the default of the cover's solver if None.
        accuracy: Wanted relative error of the finite elements; None for the usual grids [-].
        models: Models that are computed, some of `MODELS`.
        method: Contact method of the fast model.
    """

    sensor: SensorDescription | Parameters
    indenter: Indenter
    shape: str
    pose: PoseText
    load: float | None
    depth: float | None
    friction: float | None = None
    strain: Literal["small", "finite"] | None = None
    accuracy: float | None = None
    models: tuple[str, ...] = comparison.MODELS
    method: str = "default"

    @property
    def needs_reference(self) -> bool:
        """Whether the press is computed by finite elements, alone or to find the load of a given depth."""
        return "fem" in self.models or self.depth is not None

    @property
    def way_out(self) -> str:
        """Advice on how to press without finite elements, for a user who lacks them; empty if there is no such way."""
        stored = self.sensor is BUILT_IN.get(self.sensor.array.name)
        unused = self.depth is None and self.accuracy is None and not self.friction
        return "compute the fast model alone: --model fast" if stored and unused and "fast" in self.models else ""

    def is_met_by(self, found: Indentation | None) -> bool:
        """Return whether all estimated errors of a result are at most the wanted accuracy; a NaN is not.

        A result is not met either if the shape of a solid cover is too coarse for its depth.  Without finite elements,
        there is nothing to miss.
        """
        if found is None:
            return True
        from fem_reference.curved_cover.penetration import warn_of_shape

        if found.mesh is not None and warn_of_shape(found.mesh, found.depth):
            return False
        return self.accuracy is None or all(each <= self.accuracy for each in found.error_estimate.values())

    def find_case(self, progress: Progress | None = None) -> Case:
        """Return the requested indentation as a case; a solid cover is meshed to locate the place of first touch.

        Args:
            progress: Called with a line of text before each step.

        Raises:
            InputError: If the cover cannot be meshed, or the place is not on it.
        """
        pose = _find_places(self.sensor, progress).find(self.pose)
        return Case(name="press", indenter=self.indenter, shape=self.shape, load=self.load or 0.0, pose=pose)

    def run(
        self, *, fields: bool = False, as_far: bool = False, progress: Progress | None = None
    ) -> comparison.Comparison:
        """Compute the requested press by the chosen models.

        Args:
            fields: Whether the finite elements return displacement and stress in the cover.
            as_far: Whether finite elements that stop early give the result at the largest load that they reached.
            progress: Called with a line of text before each step.

        Raises:
            InputError: If the cover cannot be meshed, the place is not on it, or its solver does not support the
                request.
            PiercedError: If the indenter would pierce the cover.
            ConvergenceError: If the finite elements do not converge.
        """
        case, parameters = self.find_case(progress), None

        @cache
        def find() -> Parameters:
            return find_parameters(self.sensor, progress)

        if "fast" in self.models:
            # The fast model is derived after the finite elements, because their solver may refuse the request.  A
            # chosen contact method is checked first, because the cover may not support it.
            parameters = find
            if self.method != "default":
                from fastmodel.attachment import choose_method

                choose_method(self.method, find())
        return comparison.compare_models(
            self.sensor, case, depth=self.depth, friction=self.friction, strain=self.strain, accuracy=self.accuracy,
            models=self.models, method=self.method, fields=fields, as_far=as_far, progress=progress,
            parameters=parameters,
        )  # fmt: skip

    def trace(self, points: int, progress: Progress | None = None) -> LoadCurve:
        """Compute a curve of load over depth in equal steps by finite elements; points before an early stop are kept.

        Only loading is computed.  Without friction, unloading retraces the curve.

        Args:
            points: Number of points, at least 1; the last has the load or depth of the press [-].
            progress: Called with a line of text before each step.

        Raises:
            InputError: As for `run`, or if the cover is not known.
            IncompletePathError: If not even the first point is reached.
        """
        from fem_reference import IncompletePathError, press_path
        from validation.press_files import LoadCurve

        cover, case, stopped = comparison.find_cover(self.sensor), self.find_case(progress), ""
        friction, stated = comparison.choose_friction(self.sensor, self.friction)
        control, last = ("loads", self.load) if self.depth is None else ("depths", self.depth)
        options: dict[str, Any] = {control: [(last or 0.0) * (i + 1) / points for i in range(points)]}
        try:
            with name_unsupported(stated, others="--"):
                found = press_path(
                    cover, self.sensor.array, case.indenter, pose=case.pose, strain=self.strain,
                    friction=friction, accuracy=self.accuracy, progress=progress, **options,
                )  # fmt: skip
        except IncompletePathError as error:
            found, stopped = error.reached, str(error)
            if not found:
                raise
        return LoadCurve(indentations=found, wanted=points, stopped=stopped)


def read_request(
    find_sensor: Callable[[bool], SensorDescription | Parameters],
    indenter: str,
    *,
    load: str | None = None,
    depth: str | None = None,
    pose: Mapping[str, str | None],
    friction: str | None = None,
    strain: str | None = None,
    accuracy: str | float | None = None,
    models: str = ",".join(comparison.MODELS),
    method: str = "default",
    curve: int | None = None,
    out: object = None,
) -> PressRequest:
    """Read the options of a press from text, and report all faults together.

    Args:
        find_sensor: Function that returns the sensor; its argument states whether finite elements are needed.
        indenter: The indenter, for example `sphere:radius=5mm`.
        load: Force along the motion, for example `5 N`; either load or depth must be given.
        depth: Approach of the indenter from first touch, for example `0.3 mm`.
        pose: Texts of the pose of the indenter by key: `at`, `direction`, `yaw` and `tilt`, each of which may be None.
        friction: Coefficient of friction between indenter and cover, or `no-slip`.
        strain: Kind of strain of the finite elements, `small` or `finite`.
        accuracy: Wanted relative error of the finite elements, such as 0.01 or `1%`.
        models: Names of the models to compute, joined by commas.
        method: Contact method of the fast model.
        curve: Number of points of a curve of load over depth; None for a single press.
        out: Folder for the files of the press; None for no files.

    Raises:
        InputError: With one line per fault.
    """
    faults = Faults()
    chosen = faults.read(_read_models, models)
    known = chosen is not None
    needs_reference = not known or "fem" in chosen or depth is not None
    sensor = faults.read(find_sensor, known and needs_reference)
    shape = faults.read(read_indenter, indenter)
    texts = {name: text for name, text in pose.items() if text is not None}
    # The form of a pose depends on the cover, so that a pose is read only if the sensor could be read.
    placed = None if sensor is None else faults.read(_find_places(sensor).parse, texts, "--")
    if sensor is None and "yaw" in texts:  # The yaw alone is written in one way for all covers.
        faults.read(read_yaw, texts["yaw"])
    if strain not in (None, *STRAINS):
        faults.append(f"--strain: {str(strain)[:40]!r} is neither of {' and '.join(STRAINS)}")
    coefficient = faults.read(_read_friction, friction, used=needs_reference)
    faults.read(check_choice, "--method", "contact method", method, comparison.METHODS)
    if method in comparison.METHODS[1:] and known and ("fast" not in chosen or curve is not None):
        reason = "--curve is computed by finite elements" if curve is not None else "--model names the finite elements"
        faults.append(
            f"--method: {reason} alone; leave --method out, which chooses how the fast model computes contact"
        )
    wanted = faults.read(_read_accuracy, accuracy, used=needs_reference)
    force = faults.read(_read_force, load, depth)
    if (out is not None or curve is not None) and known and "fem" not in chosen:
        faults.append("--out, --curve: the files hold results of the finite elements; let --model name fem")
    if curve is not None and not 1 <= curve <= _MOST_POINTS:
        faults.append(f"--curve: accepted: 1..{_MOST_POINTS} points, not {curve}")
    if curve is not None and out is None:
        faults.append("--curve: give the folder for the curve, for example --out curve")
    faults.refuse()
    return PressRequest(
        sensor=sensor, indenter=shape, shape=indenter, pose=placed, load=force[0], depth=force[1],
        friction=coefficient, strain=cast("Literal['small', 'finite'] | None", strain), accuracy=wanted, models=chosen,
        method=method,
    )  # fmt: skip


def _find_places(sensor: SensorDescription | Parameters, progress: Progress | None = None) -> Places:
    """Return the places on a cover; on planar layers the indenter's axis must lie over the array in a single press."""
    places = find_places(sensor.cover if isinstance(sensor, SensorDescription) else None, sensor, progress)
    return replace(places, whole=True) if isinstance(places, FlatPlaces) else places


def _read_models(text: str) -> tuple[str, ...]:
    names = tuple(name.strip() for name in text.split(","))
    faults = Faults()
    for name in names:
        faults.read(check_choice, "--model", "model", name, comparison.MODELS)
    faults.refuse()
    return names


def _read_force(load: str | None, depth: str | None) -> tuple[float | None, float | None]:
    """Read the options --load and --depth, one of which must be given, and return load [N] and depth [m]."""
    if load is not None and depth is None:
        return read_load(load), None
    if depth is not None and load is None:
        return None, read_depth(depth)
    raise InputError("--load, --depth: give one of them, for example --load 4.9N or --depth 0.3mm")


def _read_friction(text: str | None, *, used: bool) -> float | None:
    """Read the option --friction, a coefficient [-], infinite for `no-slip`.

    A coefficient above 0 is refused if only the fast model is computed (`used` is false), which has no friction.
    """
    if text is None:
        return None
    value = read_friction(text, place="--friction", example="--friction 0.4")
    if value and not used:
        raise InputError("--friction: the fast model has none; leave it out, or let --model name fem")
    return value


def _read_accuracy(given: str | float | None, *, used: bool) -> float | None:
    """Read the option --accuracy, a relative error such as 1% or 0.01 [-].

    It is refused if only the fast model is computed (`used` is false), which has no error estimate.
    """
    if given is None:
        return None
    text = str(given).strip()
    try:
        value = float(text.removesuffix("%")) / (100 if text.endswith("%") else 1)
    except ValueError:
        value = math.nan
    if not 0 < value < 1:
        raise InputError(f"--accuracy: {str(given)!r} is not a share between 0 and 1; for example --accuracy 1%")
    if not used:
        raise InputError("--accuracy: the fast model has none; leave it out, or let --model name fem")
    return value
