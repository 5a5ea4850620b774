"""One press from options as text, on the command line and in Python: reading of the options, and computation."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal, cast

from meshes import Indenter
from validation.campaign.case import Case
from validation.campaign.comparison import METHODS, MODELS, Comparison
from validation.campaign.reference_press import name_unsupported
from validation.campaign.results import score_forces, texel_error
from validation.errors import Faults, InputError, check_choice
from validation.parameters import find_parameters
from validation.places import FlatPlaces, Places, PoseText, find_places
from validation.sensor_file import BUILT_IN, SensorDescription
from validation.text.friction import describe_friction, read_friction
from validation.text.indenter import read_depth, read_indenter, read_load, read_yaw

if TYPE_CHECKING:
    from fastmodel import FastIndentation, Parameters
    from fem_reference.indentation.result import Indentation
    from validation.moving.history import History
    from validation.press_files import LoadCurve
    from validation.press_history import HistoryPress

#: Kinds of strain of the finite elements that a user can name.
STRAINS = ("small", "finite")
#: Largest accepted number of points of a curve of load over depth [-].
_MOST_POINTS = 1000
#: Own error of the reference in the texels above which the fast model is not scored in a press [-].
_NO_SCORE = 0.05

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
        history: Load or depth in time; None for one load or depth.
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
    models: tuple[str, ...] = MODELS
    method: str = "default"
    history: History | None = None

    @property
    def needs_reference(self) -> bool:
        """Whether the press is computed by finite elements, alone or to find the load of a given depth."""
        return "fem" in self.models or self.depth is not None or self.history is not None

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

    def run(self, *, fields: bool = False, as_far: bool = False, progress: Progress | None = None) -> Comparison:
        """Compute the requested press by the chosen models, and score the fast model if both are chosen.

        The fast model has the force of the finite elements as its load.  It is derived after them, because their solver
        may refuse the request.

        Args:
            fields: Whether the finite elements return displacement and stress in the cover.
            as_far: Whether finite elements that stop early give the result at the largest load that they reached,
                without a fast model.  `Comparison.stopped` then states the reason.
            progress: Called with a line of text before each step.

        Raises:
            InputError: If the cover cannot be meshed, the place is not on it, or its solver does not support the
                request.
            PiercedError: If the indenter would pierce the cover.
            ConvergenceError: If the finite elements do not converge.
            FastModelError: If the method needs cover data that the sensor's parameters lack.
        """
        case, tell, parameters = self.find_case(progress), progress or (lambda _: None), None
        wanted = {"load": case.load} if self.depth is None else {"depth": self.depth}
        models, fem, fast, score, stopped, note = self.models, None, None, None, "", ""
        if "fast" in models and self.method != "default":  # which the cover may not support
            from fastmodel.attachment import choose_method

            parameters = find_parameters(self.sensor, progress)
            choose_method(self.method, parameters)
        if self.needs_reference:
            tell("indentation by finite elements")
            reached, stopped = self._press_path(
                case, 1, fields=fields, as_far=as_far, progress=lambda text: tell(f"finite elements, {text}")
            )
            fem = reached[-1]
            models = ("fem",) if stopped else models
            case = replace(case, load=fem.total_force)
            note = _refuse_score(fem) if "fast" in models else ""
        if "fast" in models and not note:
            parameters = parameters or find_parameters(self.sensor, progress)
            note = self._refuse_contact(parameters)
        if note:
            models = ("fem",)
        elif "fast" in models and parameters is not None:
            tell("indentation by the fast model")
            fast = self._press_fast(case, parameters, alone=fem is None)
            if fem is not None:
                score = score_forces(fem, fast.texel_forces, fast.outside, case.load, parameters)
        return Comparison(
            sensor=self.sensor, case=case, fem=fem, fast=fast, score=score, models=models, wanted=wanted,
            stopped=stopped, note=note,
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
        from validation.press_files import LoadCurve

        found, stopped = self._press_path(self.find_case(progress), points, as_far=True, progress=progress)
        notes = [f"{len(found)} of {points} points are reached"] if stopped else []
        if "fast" in self.models:
            notes.append("the curve is that of the finite elements alone; the fast model was not computed")
        return LoadCurve(indentations=found, wanted=points, stopped=stopped, note="; ".join(notes))

    def follow(self, progress: Progress | None = None) -> HistoryPress:
        """Follow the press on a relaxing cover in time, by finite elements.

        Args:
            progress: Called with a line of text before each step.

        Raises:
            InputError: If the cover does not relax or is not linear, or the history cannot be followed on it.
            ConvergenceError: If the finite elements do not converge.
        """
        from fem_reference.errors import PiercedError, UnsupportedError
        from fem_reference.indentation.relaxing import find_relaxation, follow_press
        from validation.press_history import HistoryPress

        if not isinstance(self.sensor, SensorDescription) or self.history is None:
            raise InputError("--history, --hold: give one of them, and a sensor file; for example --hold 60s")
        cover = self.sensor.require_layers("--history, --hold: curved covers are not computed in time")
        if self._choose_friction()[0]:
            raise InputError(f"{self._choose_friction()[1]}: histories have no friction; write --friction 0")
        case = self.find_case(progress)
        try:
            followed = follow_press(
                cover, self.sensor.array, case.indenter, case.pose, times=self.history.times,
                **{f"{self.history.control}s": self.history.values}, progress=progress,
            )  # fmt: skip
        except (PiercedError, UnsupportedError) as error:
            raise InputError(f"{self.history.place}: {error}") from None
        return HistoryPress(
            case=case, array=self.sensor.array, cover=cover, relaxation=find_relaxation(cover),
            history=self.history, followed=followed,
        )  # fmt: skip

    def _press_path(
        self, case: Case, points: int, *, fields: bool = False, as_far: bool, progress: Progress | None
    ) -> tuple[Sequence[Indentation], str]:
        """Press by finite elements in equal steps, with `as_far` as far as they get.

        Returns:
            The results and an empty text.  If the finite elements stopped early, the results that they reached, and the
            reason.
        """
        from fem_reference import IncompletePathError, press_path

        if not isinstance(self.sensor, SensorDescription):
            raise InputError("the finite elements need the description of the cover")
        friction, stated = self._choose_friction()
        target = case.load if self.depth is None else self.depth
        steps = [target * (i + 1) / points for i in range(points)]
        try:
            with name_unsupported(stated, others="--"):
                return press_path(
                    self.sensor.cover, self.sensor.array, case.indenter, case.pose,
                    loads=steps if self.depth is None else None, depths=None if self.depth is None else steps,
                    friction=friction, strain=self.strain, accuracy=self.accuracy, fields=fields, progress=progress,
                ), ""  # fmt: skip
        except IncompletePathError as error:
            if not as_far or not error.reached:
                raise
            return error.reached, str(error)

    def _press_fast(self, case: Case, parameters: Parameters, *, alone: bool) -> FastIndentation:
        """Press by the fast model, with a warning if the press has friction, which the fast model has not."""
        from fastmodel import indent

        found = indent(parameters, case.indenter, load=case.load, pose=case.pose, contact=self.method)
        friction, _ = self._choose_friction()
        if not friction:
            return found
        use = "not used" if alone else "used by the finite elements alone"
        sentence = f"the fast model has no friction; {describe_friction(friction)} is {use}"
        return replace(found, warnings=(*found.warnings, sentence))

    def _refuse_contact(self, parameters: Parameters) -> str:
        """Return why MuJoCo computes no contact with the cover, so that the fast model is left out; else empty.

        Raises:
            InputError: If the fast model alone was requested.
        """
        if not (reason := parameters.provenance.get("no_contact")):
            return ""
        if "fem" not in self.models:
            raise InputError(f"--model: {reason}; write --model fem")
        return f"{reason}; --model fem leaves it out"

    def _choose_friction(self) -> tuple[float, str]:
        """Choose the coefficient of friction of the press: the given one, else that of the sensor file, else 0.

        Returns:
            The coefficient [-], and the option or the key of the sensor file that states it.
        """
        if self.friction is not None:
            return self.friction, "--friction"
        return getattr(self.sensor, "friction", 0.0), f"{getattr(self.sensor, 'source', '')}: contact.friction"


def _refuse_score(fem: Indentation) -> str:
    """Return why the fast model is not derived for a score: the finite elements' own error; empty if it is small."""
    if not (own := texel_error(fem.error_estimate)) > _NO_SCORE:  # also without an estimate
        return ""
    return (
        f"the finite elements state an error of {100 * own:.2g} % for the texels, more than the fast model usually "
        "has, so it is not derived for a score; --model fast computes it alone"
    )


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
    models: str = ",".join(MODELS),
    method: str = "default",
    curve: int | None = None,
    history: str | Path | History | None = None,
    hold: str | None = None,
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
        history: CSV file with the load or depth in time, or such a history, instead of a load or depth.
        hold: Time for which load or depth are held on a relaxing cover, for example `60s`.
        out: Folder for the files of the press; None for no files.

    Raises:
        InputError: With one line per fault.
    """
    faults = Faults()
    chosen = faults.read(_read_models, models)
    known = chosen is not None
    in_time = history is not None or hold is not None
    needs_reference = not known or "fem" in chosen or depth is not None or in_time
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
    faults.read(check_choice, "--method", "contact method", method, METHODS)
    if method in METHODS[1:] and known and ("fast" not in chosen or curve is not None):
        reason = "--curve is computed by finite elements" if curve is not None else "--model names the finite elements"
        faults.append(
            f"--method: {reason} alone; leave --method out, which chooses how the fast model computes contact"
        )
    wanted = faults.read(_read_accuracy, accuracy, used=needs_reference)
    force = faults.read(_read_force, load, depth) if history is None else (None, None)
    moved = faults.read(_read_history, history, hold, force, given=load or depth)
    if moved is not None:
        given = {"--accuracy": accuracy, "--curve": curve, "--strain finite": strain == "finite"}
        given |= {"--method": method != "default", "--model fast": chosen == ("fast",)}
        unused = [option for option, value in given.items() if value not in (None, False)]
        if unused:
            faults.append(f"--history, --hold: leave out {', '.join(unused)}, which are for one load")
    if out is not None and known and "fem" not in chosen:
        faults.append("--out: holds results of the finite elements; write --model fem, or fem,fast")
    if curve is not None and not 1 <= curve <= _MOST_POINTS:
        faults.append(f"--curve: accepted: 1..{_MOST_POINTS} points, not {curve}")
    if curve is not None and out is None:
        faults.append("--curve: give the folder for the curve, for example --out curve")
    faults.refuse()
    return PressRequest(
        sensor=sensor, indenter=shape, shape=indenter, pose=placed, load=force[0], depth=force[1],
        friction=coefficient, strain=cast("Literal['small', 'finite'] | None", strain), accuracy=wanted, models=chosen,
        method=method, history=moved,
    )  # fmt: skip


def _find_places(sensor: SensorDescription | Parameters, progress: Progress | None = None) -> Places:
    """Return the places on a cover; on planar layers the indenter's axis must lie over the array in a single press."""
    places = find_places(sensor.cover if isinstance(sensor, SensorDescription) else None, sensor, progress)
    return replace(places, whole=True) if isinstance(places, FlatPlaces) else places


def _read_models(text: str) -> tuple[str, ...]:
    names = tuple(name.strip() for name in text.split(","))
    faults = Faults()
    for name in names:
        faults.read(check_choice, "--model", "model", name, MODELS)
    faults.refuse()
    return names


def _read_force(load: str | None, depth: str | None) -> tuple[float | None, float | None]:
    """Read the options --load and --depth, one of which must be given, and return load [N] and depth [m]."""
    if load is not None and depth is None:
        return read_load(load), None
    if depth is not None and load is None:
        return None, read_depth(depth)
    raise InputError("--load, --depth: give one of them, for example --load 4.9N or --depth 0.3mm")


def _read_history(
    source: str | Path | History | None,
    hold: str | None,
    force: tuple[float | None, float | None] | None,
    *,
    given: str | None,
) -> History | None:
    """Read the options --history and --hold, given the load [N] and depth [m] of the press; None without both."""
    from validation.press_history import read_history, read_hold

    if source is not None and (hold is not None or given is not None):
        raise InputError("--history: leave out --load, --depth and --hold, which it replaces")
    if source is not None:
        return read_history(source)
    if hold is None or force is None:
        return None
    load, depth = force
    return read_hold(hold, "depth", depth) if depth is not None else read_hold(hold, "load", load or 0.0)


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
