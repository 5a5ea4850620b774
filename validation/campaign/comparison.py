"""Comparison of the finite-element model and the fast model in one indentation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from validation.campaign.case import Case, tabulate_pose
from validation.campaign.results import Reference
from validation.cover_meshes import describe_mesh
from validation.metrics import Score
from validation.sensor_file import SensorDescription

if TYPE_CHECKING:
    from fastmodel import FastIndentation, Parameters
    from fem_reference.indentation.result import Indentation

#: Models that a user can name: finite elements and the fast model.
MODELS = ("fem", "fast")
#: Contact methods of the fast model that a user can name.
METHODS = ("default", "cover", "foundation", "boxes", "curved")


@dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """Results of the finite-element model and the fast model for one indentation.

    Attributes:
        sensor: Description of the pressed sensor, or the parameters of its fast model if the cover is not known.
        case: Indentation.  If finite elements were computed, its load is their force.
        fem: Result of the finite elements; None unless `models` contains `fem` or a depth was given.
        fast: Result of the fast model; None unless `models` contains `fast`.
        score: Score of the fast model against the finite elements; None unless there are results of both models.
        models: Names of the models that were chosen, some of `MODELS`.
        wanted: Requested load [N] or depth [m], under the name `load` or `depth`.
        stopped: Load or depth at which the finite elements stopped early, with the reason; empty if they did not stop.
        note: Reason why a chosen model was left out; empty if none was.
    """

    sensor: SensorDescription | Parameters
    case: Case
    fem: Indentation | None
    fast: FastIndentation | None
    score: Score | None
    models: Sequence[str]
    wanted: Mapping[str, float]
    stopped: str = ""
    note: str = ""

    @property
    def indentations(self) -> tuple[Indentation, ...]:
        """The result of the finite elements, if there is one."""
        return (self.fem,) if self.fem else ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences about reasons not to rely on the results."""
        return tuple(sentence for each in (self.fem, self.fast) if each for sentence in each.warnings)

    def as_json(self) -> dict[str, Any]:
        """Return the results as a dictionary, under the names that the command line prints as JSON."""
        sensor, image = self.sensor, self.sensor.array.image
        models: dict[str, Any] = {}
        if self.fem is not None and "fem" in self.models:
            mesh = self.fem.mesh
            errors = self.fem.texel_errors
            models["fem"] = Reference.of(self.fem).as_json() | {
                "texel_forces": image(self.fem.texel_forces),
                "texel_errors": None if errors is None else image(errors),
                "mesh": None if mesh is None else describe_mesh(mesh),
            }
        if self.fast is not None:
            fast, along = self.fast, self.fast.total_force * self.case.pose.towards
            models["fast"] = {
                "texel_forces": image(fast.texel_forces),
                "contact_forces": image(fast.contact_forces),
                # With rigid boxes as texels the depth is None, because the penetration depends on a setting of MuJoCo.
                **{name: getattr(fast, name) for name in ("outside", "total_force", "method", "depth", "seconds")},
                "force": along if fast.force is None else fast.force,
                "misplaced_force": None if self.score is None else self.score.misplaced_force,
                "warnings": list(fast.warnings),
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
