"""Comparison of the finite-element model and the fast model in MuJoCo in one indentation."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from meshes import tilt_indenter
from validation.campaign.case import Case, tabulate_pose
from validation.campaign.results import Reference, score_forces
from validation.errors import InputError
from validation.metrics import Score
from validation.sensor_file import SensorDescription
from validation.text.friction import describe_friction

if TYPE_CHECKING:
    from fastmodel import FastIndentation, Parameters
    from fem_reference.indentation.result import Indentation

Progress = Callable[[str], None]

#: Models that a user can name: finite elements and the fast model.
MODELS = ("fem", "fast")
#: Contact methods of the fast model that a user can name.
METHODS = ("default", "cover", "foundation", "area", "boxes", "curved")


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """Results of the finite-element model and the fast model for one indentation.

    Attributes:
        sensor: The sensor that is pressed, or the parameters of the sensor's fast model if its cover is not known.
        case: The indentation.  If a depth was given, the load of the case is the finite elements' force at that depth.
        fem: Result of the finite elements; None unless `models` contains `fem` or a depth was given.
        fast: Result of the fast model; None unless `models` contains `fast`.
        score: Score of the fast model against the finite elements; None unless there are results of both models.
        models: Names of the models that the user chose, some of `MODELS`.
        wanted: Load [N] or depth [m] that was asked for, under the name `load` or `depth`.
        stopped: How far the finite elements came and why they stopped early; empty if they did not.
    """

    sensor: SensorDescription | Parameters
    case: Case
    fem: Indentation | None
    fast: FastIndentation | None
    score: Score | None
    models: Sequence[str]
    wanted: Mapping[str, float]
    stopped: str = ""

    def as_json(self) -> dict[str, Any]:
        """Return the results as a dictionary, under the names that the command line prints as JSON."""
        sensor, image = self.sensor, self.sensor.array.image
        models: dict[str, Any] = {}
        if self.fem is not None and "fem" in self.models:
            models["fem"] = Reference.of(self.fem).as_json() | {
                "texel_forces": image(self.fem.texel_forces),
                "mesh": None,
            }
        if self.fast is not None:
            models["fast"] = {
                "texel_forces": image(self.fast.texel_forces),
                "contact_forces": image(self.fast.contact_forces),
                # With rigid boxes as texels the depth is None: the penetration depends on a setting of MuJoCo.
                **{name: getattr(self.fast, name) for name in ("outside", "total_force", "method", "depth", "seconds")},
                "force": [0.0, 0.0, -self.fast.total_force],
                "misplaced_force": None if self.score is None else self.score.misplaced_force,
                "warnings": list(self.fast.warnings),
            }
        return {
            "sensor": sensor.array.name,
            "cover": sensor.describe_cover() if isinstance(sensor, SensorDescription) else None,
            "indenter": self.case.shape,
            "load": self.case.load,
            "wanted": dict(self.wanted),
            "stopped": self.stopped or None,
            **tabulate_pose(self.case.pose),
            "models": models,
            "scores": None if self.score is None else self.score.as_json(),
        }


def compare_models(
    sensor: SensorDescription | Parameters,
    case: Case,
    *,
    parameters: Parameters | None = None,
    depth: float | None = None,
    friction: float = 0.0,
    accuracy: float | None = None,
    models: Sequence[str] = MODELS,
    method: str = "default",
    fields: bool = False,
    progress: Progress | None = None,
) -> Comparison:
    """Compute one indentation by the chosen models, and score the fast model if both are chosen.

    Args:
        sensor: Description of the sensor that is pressed, or the parameters of its fast model.
        case: The indentation: indenter, pose and load.
        parameters: Parameters of the sensor's fast model; required if `models` contains `fast`.
        depth: Approach of the indenter, which replaces the load; the fast model's load is then that force [m].
        friction: Coulomb friction coefficient between indenter and cover for finite elements, inf for no slip; the
            fast model has none, which its warnings then say [-].
        accuracy: Wanted relative error of the finite elements; None for the usual grids [-].
        models: Names of the models, some of `MODELS`.
        method: Contact method of the fast model, one of `METHODS`.
        fields: Whether the finite elements also return displacement and stress in the cover.
        progress: Called with a line of text before each step.

    Raises:
        ValueError: If the finite elements are chosen without a description, or the fast model without parameters.
        ConvergenceError: If the finite-element solver did not converge.
        FastModelError: If the method needs cover data that the sensor's parameters lack.
    """
    tell = progress or (lambda _: None)
    wanted = _name_target(case, depth)
    fem, fast = None, None
    if "fem" in models or depth is not None:
        tell("indentation by finite elements")
        fem = _press(sensor, case, depth=depth, friction=friction, accuracy=accuracy, fields=fields, tell=tell)
        case = dataclasses.replace(case, load=fem.total_force)
    if "fast" in models:
        from fastmodel import indent

        if parameters is None:
            raise ValueError("the fast model needs its parameters")
        tell("indentation by the fast model")
        indenter = tilt_indenter(case.indenter, case.pose.tilt)
        fast = indent(parameters, indenter, load=case.load, at=case.pose.at, yaw=case.pose.yaw, method=method)
        if friction:
            use = "not used" if fem is None else "used by the finite elements alone"
            sentence = f"the fast model has no friction; {describe_friction(friction)} is {use}"
            fast = dataclasses.replace(fast, warnings=(*fast.warnings, sentence))
    score = None
    if fem is not None and fast is not None and parameters is not None:
        score = score_forces(fem, fast.texel_forces, fast.outside, case.load, parameters)
    return Comparison(sensor=sensor, case=case, fem=fem, fast=fast, score=score, models=tuple(models), wanted=wanted)


def compare_models_as_far(
    sensor: SensorDescription | Parameters,
    case: Case,
    **options: Any,  # noqa: ANN401 -- those of `compare_models`
) -> Comparison:
    """Compare the models as `compare_models` does; return what the finite elements reached if they stop early.

    Returns:
        The comparison.  If its `stopped` is not empty, it is that of the largest load that the finite elements reached,
        and has no fast model.

    Raises:
        ConvergenceError: If the finite elements reached nothing, and as for `compare_models`.
    """
    from fem_reference import IncompletePathError

    try:
        return compare_models(sensor, case, **options)
    except IncompletePathError as error:
        if not error.reached:
            raise
        return Comparison(
            sensor=sensor,
            case=dataclasses.replace(case, load=error.reached[-1].total_force),
            fem=error.reached[-1],
            fast=None,
            score=None,
            models=("fem",),
            wanted=_name_target(case, options.get("depth")),
            stopped=str(error),
        )


def _name_target(case: Case, depth: float | None) -> dict[str, float]:
    """Return the load of a case [N], or the depth that replaces it [m], by its name."""
    return {"load": case.load} if depth is None else {"depth": depth}


def _press(
    sensor: SensorDescription | Parameters,
    case: Case,
    *,
    depth: float | None,
    tell: Progress,
    **options: Any,  # noqa: ANN401 -- those of `press`
) -> Indentation:
    """Compute one indentation by finite elements, at the depth if it is given and else at the load of the case."""
    from fem_reference.errors import UnsupportedError
    from fem_reference.indentation.press import press

    if not isinstance(sensor, SensorDescription):
        raise InputError("the finite elements need the description of the cover")
    try:
        return press(
            sensor.cover,
            sensor.array,
            case.indenter,
            load=case.load if depth is None else None,
            depth=depth,
            pose=case.pose,
            progress=lambda text: tell(f"finite elements, {text}"),
            **options,
        )
    except UnsupportedError as error:
        raise InputError(f"--{error.argument}: {error}") from None
