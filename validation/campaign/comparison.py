"""One indentation by the finite elements and by the fast model, side by side."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from validation.campaign.case import Case
from validation.campaign.run import describe_reference, score_forces
from validation.metrics import Score
from validation.sensor_file import SensorDescription

if TYPE_CHECKING:
    from fastmodel import FastIndentation, Parameters
    from fem_reference.indentation.press import Indentation

Progress = Callable[[str], None]

#: Models that a user can name.
MODELS = ("fem", "fast")
#: Contact methods of the fast model that a user can name.
METHODS = ("default", "cover", "foundation", "area", "boxes")


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """The results of the models for one indentation.

    Attributes:
        sensor: The sensor that is pressed, or the parameters of its fast model if its cover is not known.
        case: The indentation.  If a depth was given, its load is the reference's at that depth.
        fem: By the finite elements; None unless the models name it or a depth was given.
        fast: By the fast model; None if the models do not name it.
        score: Fast model against finite elements; None unless both are there.
        models: The models that the user named.
    """

    sensor: SensorDescription | Parameters
    case: Case
    fem: Indentation | None
    fast: FastIndentation | None
    score: Score | None
    models: Sequence[str]

    def as_json(self) -> dict[str, Any]:
        """The result under the names that the command line prints."""
        sensor, image = self.sensor, self.sensor.array.image
        models: dict[str, Any] = {}
        if self.fem is not None and "fem" in self.models:
            models["fem"] = describe_reference(self.fem) | {"texel_forces": image(self.fem.texel_forces)}
        if self.fast is not None:
            models["fast"] = {
                "texel_forces": image(self.fast.texel_forces),
                "contact_forces": image(self.fast.contact_forces),
                # The depth is None with rigid boxes, whose penetration depends on a setting of the physics engine.
                **{name: getattr(self.fast, name) for name in ("outside", "total_force", "method", "depth", "seconds")},
            }
        return {
            "sensor": sensor.array.name,
            "cover": sensor.describe_cover() if isinstance(sensor, SensorDescription) else None,
            "indenter": self.case.shape,
            "load": self.case.load,
            "at": list(self.case.at),
            "yaw": self.case.yaw,
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
    models: Sequence[str] = MODELS,
    method: str = "default",
    progress: Progress | None = None,
) -> Comparison:
    """Press one case by the named models.

    Args:
        sensor: The sensor that is pressed; the finite elements need its description.
        case: Indenter, pose and load.
        parameters: Parameters of the sensor's fast model; the fast model needs them.
        depth: Approach from first touch that replaces the load; the fast model takes the reference's load there [m].
        friction: Coulomb's coefficient between indenter and cover in the reference, inf for no slip [-].
        models: Some of `MODELS`.
        method: The fast model's contact method, one of `METHODS`.
        progress: Called with a line of text before each step.

    Raises:
        ValueError: If a named model lacks the description or the parameters.
        ConvergenceError: If the reference did not converge.
        FastModelError: If the method needs cover data that the sensor's parameters lack.
    """
    tell = progress or (lambda _: None)
    fem, fast = None, None
    if "fem" in models or depth is not None:
        from fem_reference.indentation.press import press

        if not isinstance(sensor, SensorDescription):
            raise ValueError("the finite elements need the description of the cover")
        tell("indentation by finite elements")
        fem = press(
            sensor.cover,
            sensor.array,
            case.indenter,
            load=case.load if depth is None else None,
            depth=depth,
            at=case.at,
            yaw=case.yaw,
            friction=friction,
            progress=lambda text: tell(f"finite elements, {text}"),
        )
        case = dataclasses.replace(case, load=fem.total_force)
    if "fast" in models:
        from fastmodel import indent

        if parameters is None:
            raise ValueError("the fast model needs its parameters")
        tell("indentation by the fast model")
        fast = indent(parameters, case.indenter, load=case.load, at=case.at, yaw=case.yaw, method=method)
    score = None
    if fem is not None and fast is not None:
        score = score_forces(fem, fast.texel_forces, fast.outside, case.load, sensor.array)
    return Comparison(sensor=sensor, case=case, fem=fem, fast=fast, score=score, models=tuple(models))
