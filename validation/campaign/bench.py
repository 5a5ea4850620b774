"""A bench: one sensor with its reference and all models, for the presses of a campaign.

A campaign and the evidence on its credibility use a bench and never depend on the kind of cover. `left_out` lists what
a bench does not compute, with reasons.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial, singledispatch
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from meshes import Cover
from validation.campaign.campaign_file import Inputs
from validation.campaign.case import Case
from validation.campaign.reference_press import press_reference
from validation.campaign.results import MODELS, CaseResult, Reference, predict

if TYPE_CHECKING:
    from fastmodel import Parameters
    from meshes.array_types import FloatArray
    from validation.credibility.stages import StageErrors
    from validation.credibility.uncertainty import InputUncertainty
    from validation.credibility.verification import Check
    from validation.published.models import ComparisonModels
    from validation.sensor_file import SensorDescription

#: Load that divides the cases into the two groups of light and heavy ones [N].
_HEAVY = 2.0
#: Share of the load outside the array above which a case counts as over an edge of the array [-].
_AT_EDGE = 0.05


class ModelForces(NamedTuple):
    """Forces of all models in one case: on the n texels, shape (n,), and outside [N], by the name of the model.

    Attributes:
        models: Forces of the models of the bench.
        published: Forces of the published models.
        warnings: Sentences about reasons not to rely on the fast model.
    """

    models: Mapping[str, tuple[FloatArray, float]]
    published: Mapping[str, tuple[FloatArray, float]] = {}
    warnings: tuple[str, ...] = ()


class Verification(NamedTuple):
    """Name of a verified quantity, function that verifies it, and expected processor time [s]."""

    name: str
    check: Callable[[], Sequence[Check]]
    seconds: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Bench(ABC):
    """Interface between a campaign and a sensor: reference, models, verification and classes of cases.

    There is one subclass for each kind of cover.

    Attributes:
        cover: The cover in the finite-element model.
        parameters: Parameters of the fast model.
        friction: Coulomb friction coefficient between indenter and cover in the finite elements, inf for no slip [-].
        comparison: Published models that are scored in the same cases, already fitted; None for none.
    """

    #: Names of the scored models, with a description of each for tables.  One of them is `fast`.
    models: ClassVar[Mapping[str, str]]
    #: Sections of the report that are not computed for this kind of cover, each with its reason or cost as a sentence.
    left_out: ClassVar[tuple[str, ...]] = ()
    #: Information for readers of the report about this kind of cover: a paragraph by the name of the section.
    notes: ClassVar[Mapping[str, str]] = {}

    cover: Any
    parameters: Parameters
    friction: float = 0.0
    comparison: ComparisonModels | None = None

    def solve(self, case: Case, progress: Callable[[str], None] | None = None) -> CaseResult:
        """Compute one case by finite elements and by all models, and score the models.

        Args:
            case: The indentation.
            progress: Called with a line of text before each step of the finite elements.

        Raises:
            ValueError: If a model cannot compute the case.
            ConvergenceError: If the finite elements did not converge.
        """
        array = self.parameters.array
        found = press_reference(self.cover, array, case, friction=self.friction, progress=progress)
        reference, forces = Reference.of(found), self.compute_models(case)
        return CaseResult(
            case=case,
            reference=reference,
            predictions=predict(reference, forces.models, case.load, self.parameters),
            warnings=forces.warnings,
            published=predict(reference, forces.published, case.load, self.parameters),
        )

    @abstractmethod
    def compute_models(self, case: Case) -> ModelForces:
        """Compute one case by all models.

        Raises:
            ValueError: If a model cannot compute the case.
        """

    @abstractmethod
    def verify(self, results: Sequence[CaseResult]) -> Iterator[Verification]:
        """Yield the checks of the solvers."""

    @abstractmethod
    def propagate(self, case: Case, inputs: Inputs) -> InputUncertainty:
        """Compute the effect of uncertain inputs, such as modulus and position, on the texel forces of a case.

        Args:
            case: The indentation.
            inputs: Standard uncertainty of each input.

        Returns:
            Texel forces with the nominal inputs, and their change by one standard uncertainty of each input.
        """

    def score_stages(self, results: Sequence[CaseResult]) -> StageErrors | None:  # noqa: ARG002 -- for others
        """Score the stages of the fast model; None where stages are left out or the model has no cover data."""
        return None

    @abstractmethod
    def classify(self, result: CaseResult) -> Mapping[str, str]:
        """Return the classes of a case in several classifications, for which errors are pooled.

        Returns:
            Name of the class by the name of the classification, such as `{"load": "below 2 N"}`.
        """

    def measure(self, result: CaseResult) -> dict[str, float]:
        """Return the quantities of a case whose ranges are the validated domain; the names end in the units.

        They are load, depth over thickness, and contact area.  A subclass adds further quantities.
        """
        return {
            "load_N": result.case.load,
            "depth_over_thickness": result.reference.depth / self.cover.thickness,
            "contact_area_m2": result.reference.contact_area,
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class LayeredBench(Bench):
    """Bench of a sensor with a cover of flat layers."""

    models = MODELS
    notes: ClassVar[Mapping[str, str]] = {
        "cases": ("Row 0 is at the bottom. The dashed line is the edge of the contact area in the reference."),
        "uncertainty": (
            "Images on the linear cover, coarse cells. Friction: half-space between frictionless and its bound as a "
            "uniform distribution; flat faces that are not round are represented by a cylinder of equal area."
        ),
        "verification": (
            "Flat faces are extrapolated with order 1, because the pressure at a sharp edge is singular; the result "
            "then differs from the finest grid. A dash means that the three values are not monotonic. Contact areas "
            "scatter with the place of the edge within a cell."
        ),
        "calibration": (
            "The kernel: least squares to one reference response, unit force as uniform pressure over the middle "
            "texel, before any case was pressed, and unchanged afterwards. The shape of a single layer's point spread "
            "function does not depend on the modulus."
        ),
        "limits": (
            "Only a cover of a stated size has free side edges. The indenter is guided and does not tilt. The methods "
            "boxes and no-spread share a flat face by number of contact points, not by area; this dominates their "
            "error under flat indenters."
        ),
    }
    cover: Cover

    def compute_models(self, case: Case) -> ModelForces:
        """Compute one case by the fast model, by simpler contact methods, and by the published models."""
        from fastmodel import Placement, indent_together

        array, parts = self.parameters.array, [each.turned for each in case.bodies]
        placements = [
            Placement(indenter=each.indenter, load=each.load, at=each.pose.at, yaw=each.pose.yaw) for each in parts
        ]
        press = partial(indent_together, self.parameters, placements)
        fast, foundation = press(contact="default"), press(contact="foundation")
        published: Mapping[str, tuple[FloatArray, float]] = {}
        if self.comparison is None:
            boxes = [press(contact="boxes")]
        else:
            # The published models use the contacts of the simulation of the method `boxes`.  They see one body at a
            # time, and their forces add up.
            found = [self.comparison.predict(self.cover, self.parameters, each) for each in parts]
            boxes = [scene.boxes for scene, _ in found]
            published = {name: _add([forces[name] for _, forces in found]) for name in found[0][1]}
        kept = np.where(array.active, sum(each.contact_forces for each in boxes), 0.0)
        models = {
            "fast": (fast.texel_forces, fast.outside),
            "foundation": (foundation.texel_forces, foundation.outside),
            "boxes": _add([(each.texel_forces, each.outside) for each in boxes]),
            "no-spread": (kept, case.load - float(kept.sum())),
            "zeros": (np.zeros(array.count), 0.0),
        }
        return ModelForces(models, published, fast.warnings)

    def verify(
        self,
        results: Sequence[CaseResult],  # noqa: ARG002 -- other covers press a case
    ) -> Iterator[Verification]:
        """Yield the checks of the codes against closed forms on this cover."""
        from validation.credibility.verification import verify_code

        wide = replace(self.cover, size=None)
        yield Verification("code verification", partial(verify_code, wide, self.parameters.array))

    def propagate(self, case: Case, inputs: Inputs) -> InputUncertainty:
        """Propagate the uncertain inputs to the image of a case."""
        from validation.credibility.uncertainty import propagate_inputs

        found = propagate_inputs(replace(self.cover, size=None), self.parameters.array, case, inputs)
        if self.cover.size is None:
            return found
        return replace(found, note="; ".join(filter(None, (found.note, "on a wide cover of these layers"))))

    def score_stages(self, results: Sequence[CaseResult]) -> StageErrors | None:
        """Score the stages of the fast model; None if it has no tables of the cover."""
        from validation.credibility.stages import score_stages

        return score_stages(self.cover, self.parameters, results)

    def classify(self, result: CaseResult) -> Mapping[str, str]:
        """Return load, shape and pose of a case as words."""
        case, outside = result.case, result.reference.outside / result.case.load
        turned = math.degrees(case.pose.yaw) % 90 != 0
        return {
            "load": "below 2 N" if case.load < _HEAVY else "2 N and more",
            "shape": case.shape.split(":")[0],
            "pose": "over an edge" if outside > _AT_EDGE else "turned" if turned else "inside, not turned",
        }

    def measure(self, result: CaseResult) -> dict[str, float]:
        """Return the quantities of every bench, and the share of the load outside the array [-]."""
        return super().measure(result) | {"share_outside_array": result.reference.outside / result.case.load}


def _add(forces: Sequence[tuple[FloatArray, float]]) -> tuple[FloatArray, float]:
    """Add forces on n texels, shape (n,), and outside [N]."""
    texels, outside = zip(*forces, strict=True)
    return np.sum(texels, axis=0), sum(outside)


@singledispatch
def prepare_bench(
    derivation: Any,  # noqa: ANN401 -- by its type
    cases: Sequence[Case],
    progress: Callable[[str], None] | None = None,
    *,
    parameters: Parameters | None = None,
) -> Bench:
    """Return the bench on which cases are scored: that of planar layers, unless another one is registered.

    Args:
        derivation: Derivation of a sensor.  Modules of other kinds of cover register a function for their derivations.
        cases: Cases that will be scored; no model may be fitted to them.
        progress: Called with the name of each part.
        parameters: Parameters of the fast model that replace the derived ones; no published model is scored then.

    Raises:
        InputError: If the fast model of the sensor cannot be scored.
    """
    from validation.published.models import prepare_models

    sensor: SensorDescription = derivation.sensor
    cover, friction = sensor.layered_cover, sensor.friction
    if parameters is not None:
        return LayeredBench(cover=cover, parameters=parameters, friction=friction)
    if progress:
        progress("fit of the comparison models")
    comparison = prepare_models(cover, derivation.parameters, cases, friction=friction, progress=progress)
    return LayeredBench(cover=cover, parameters=derivation.parameters, friction=friction, comparison=comparison)
