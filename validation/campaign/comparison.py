"""One indentation by several models, side by side."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from validation.campaign.case import Case
from validation.derivation.derive import derive, describe_cover
from validation.metrics import Score, score
from validation.sensor_file import SensorDescription

if TYPE_CHECKING:
    from fastmodel import FastIndentation
    from fem_reference.indentation.press import Indentation

Progress = Callable[[str], None]

#: Models that can be asked for.
MODELS = ("fem", "fast")
#: Contact methods of the fast model that can be asked for.
METHODS = ("default", "cover", "foundation", "area", "boxes")


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """What the models say about one indentation.

    Attributes:
        sensor: What was pressed.
        case: The indentation; its load is the reference's where a depth was asked for.
        fem: By the finite elements, if asked for or needed.
        fast: By the fast model, if asked for.
        score: Fast model against finite elements, if both are there.
        models: The models that were asked for.
    """

    sensor: SensorDescription
    case: Case
    fem: Indentation | None
    fast: FastIndentation | None
    score: Score | None
    models: Sequence[str]

    def as_json(self) -> dict[str, Any]:
        """The result under the names that the command line prints."""
        models: dict[str, Any] = {}
        if self.fem is not None and "fem" in self.models:
            models["fem"] = self._fem_json(self.fem)
        if self.fast is not None:
            models["fast"] = self._fast_json(self.fast)
        return {
            "sensor": self.sensor.name,
            "cover": describe_cover(self.sensor.cover),
            "indenter": self.case.shape,
            "load": self.case.load,
            "at": list(self.case.at),
            "yaw": self.case.yaw,
            "models": models,
            "scores": None if self.score is None else self.score.as_json(),
        }

    def _fem_json(self, fem: Indentation) -> dict[str, Any]:
        return {
            "texel_forces": self.sensor.array.image(fem.texel_forces),
            "outside": fem.outside,
            "total_force": fem.total_force,
            "depth": fem.depth,
            "contact_area": fem.contact_area,
            "error_estimate": dict(fem.error_estimate),
            "assumptions": dict(fem.assumptions),
            "seconds": fem.seconds,
        }

    def _fast_json(self, fast: FastIndentation) -> dict[str, Any]:
        return {
            "texel_forces": self.sensor.array.image(fast.texel_forces),
            "contact_forces": self.sensor.array.image(fast.contact_forces),
            "outside": fast.outside,
            "total_force": fast.total_force,
            "method": fast.method,
            # None with rigid boxes: how far they let an object sink is a setting of the engine.
            "depth": fast.depth,
            "seconds": fast.seconds,
        }


def compare_models(
    sensor: SensorDescription,
    case: Case,
    *,
    depth: float | None = None,
    friction: float = 0.0,
    models: Sequence[str] = MODELS,
    method: str = "default",
    progress: Progress | None = None,
) -> Comparison:
    """Press one case by the models that are asked for.

    Args:
        sensor: What is pressed.
        case: Indenter, pose and load.
        depth: Approach that replaces the load; the fast model takes the reference's load there [m].
        friction: Between indenter and cover, for the reference: Coulomb's coefficient, inf for no slip [-].
        models: Some of `MODELS`.
        method: The fast model's contact method, one of `METHODS`.
        progress: Told what is being done.

    Raises:
        ConvergenceError: If the reference did not converge.
        FastModelError: If the method needs cover data that the sensor's parameters lack.
    """
    tell = progress or (lambda _: None)
    fem, fast = None, None
    if "fem" in models or depth is not None:
        tell("indentation by finite elements")
        fem = _press(sensor, case, depth, friction, tell)
        case = dataclasses.replace(case, load=fem.total_force)
    if "fast" in models:
        from fastmodel import indent

        parameters = derive(sensor, progress=progress).parameters
        tell("indentation by the fast model")
        fast = indent(parameters, case.indenter, load=case.load, at=case.at, yaw=case.yaw, method=method)
    both = fast is not None and fem is not None
    return Comparison(
        sensor=sensor,
        case=case,
        fem=fem,
        fast=fast,
        score=_score(sensor, case, fem, fast) if both else None,
        models=tuple(models),
    )


def _press(sensor: SensorDescription, case: Case, depth: float | None, friction: float, tell: Progress) -> Indentation:
    from fem_reference.indentation.press import press

    return press(
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


def _score(
    sensor: SensorDescription, case: Case, fem: Indentation | None, fast: FastIndentation | None
) -> Score | None:
    if fem is None or fast is None:
        return None
    return score(
        fem.texel_forces,
        fast.texel_forces,
        reference_outside=fem.outside,
        outside=fast.outside,
        load=case.load,
        array=sensor.array,
    )
