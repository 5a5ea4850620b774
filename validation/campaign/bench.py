"""A bench: one sensor, ready to be pressed by the reference and by all models.

A campaign and the evidence beside its scores ask a bench and never for the kind of its cover.  A bench says by
`left_out` what it does not compute, and why.
"""

from __future__ import annotations

import dataclasses
import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial, singledispatch
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from meshes import Cover, TexelArray
from validation.campaign.campaign_file import Inputs
from validation.campaign.case import Case
from validation.campaign.reference_press import find_stored_reference, press_reference
from validation.campaign.results import MODELS, CaseResult, Reference, predict
from validation.derivation.layers import LayeredDerivation

if TYPE_CHECKING:
    from fastmodel import Parameters
    from meshes.array_types import FloatArray
    from validation.credibility.stages import StageErrors
    from validation.credibility.uncertainty import InputUncertainty
    from validation.credibility.verification import Check
    from validation.published.models import ComparisonModels
    from validation.sensor_file import SensorDescription

#: Load between the two groups of loads [N], and share of the load outside the array above which a case is at the edge.
_HEAVY, _AT_EDGE = 2.0, 0.05


class Bench(ABC):
    """What a campaign asks of a sensor with any cover."""

    #: Names of the scored models, with a description of each for tables; one is `fast`.
    models: ClassVar[Mapping[str, str]]
    #: Sections of the report that are not computed for this kind of cover, with the reason or the cost, as sentences.
    left_out: ClassVar[tuple[str, ...]] = ()
    #: What readers of the report must know about this kind of cover, a paragraph by the name of the section.
    notes: ClassVar[Mapping[str, str]] = {}

    @property
    @abstractmethod
    def parameters(self) -> Parameters:
        """Parameters of the fast model."""

    @property
    def comparison(self) -> ComparisonModels | None:
        """Published models that are scored in the same cases; None for none."""
        return None

    @abstractmethod
    def plan(self, cases: Sequence[Case]) -> Plan:
        """Find out which presses are missing from the store, and how long the cases take."""

    @abstractmethod
    def solve(self, case: Case) -> CaseResult:
        """Compute one case by finite elements and by all models, and score the models.

        Raises:
            ValueError: If a model cannot compute the case.
            ConvergenceError: If the finite elements did not converge.
        """

    @abstractmethod
    def verify(self, results: Sequence[CaseResult]) -> Iterator[tuple[str, Callable[[], Sequence[Check]]]]:
        """Yield the checks of the codes: what is verified, and a function that does it."""

    @abstractmethod
    def propagate(self, case: Case, inputs: Inputs) -> InputUncertainty:
        """Propagate the uncertain inputs to the image of a case."""

    def score_stages(self, results: Sequence[CaseResult]) -> StageErrors | None:  # noqa: ARG002 -- for others
        """Score the stages of the fast model; None where that is left out or the model has no cover data."""
        return None

    @abstractmethod
    def classify(self, result: CaseResult) -> Mapping[str, str]:
        """Return the groups of a case whose errors are pooled: the name of its member by the name of the group."""

    @abstractmethod
    def measure(self, result: CaseResult) -> Mapping[str, float]:
        """Return the quantities of a case whose ranges are the validated domain, in SI units."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LayeredBench(Bench):
    """A wide cover of flat layers.

    Attributes:
        cover: The cover in the finite-element model.
        fast: Parameters of the fast model.
        friction: Coulomb friction coefficient between indenter and cover in the finite elements, inf for no slip [-].
        published: Published models, already fitted (`prepare_models`); None for none.
    """

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
            "The cover is laterally wide, without free edges. The indenter is guided and does not tilt. The methods "
            "boxes and no-spread share a flat face by number of contact points, not by area; this dominates their "
            "error under flat indenters."
        ),
    }
    cover: Cover
    fast: Parameters
    friction: float = 0.0
    published: ComparisonModels | None = field(default=None)

    @property
    def parameters(self) -> Parameters:
        """Parameters of the fast model."""
        return self.fast

    @property
    def comparison(self) -> ComparisonModels | None:
        """Published models that are scored in the same cases; None for none."""
        return self.published

    def plan(self, cases: Sequence[Case]) -> Plan:
        """Find out which presses are missing from the store, and how long the cases take."""
        return plan_solves(self.cover, self.fast.array, cases, friction=self.friction)

    def solve(self, case: Case) -> CaseResult:
        """Compute one case by finite elements and by all models, and score the models."""
        from fastmodel import indent

        parameters, array = self.fast, self.fast.array
        reference = Reference.of(press_reference(self.cover, array, case, friction=self.friction))
        turned = case.turned
        press = partial(indent, parameters, turned.indenter, load=case.load, at=case.pose.at, yaw=case.pose.yaw)
        fast, area = press(method="default"), press(method="area")
        published: Mapping[str, tuple[FloatArray, float]] = {}
        if self.published is None:
            boxes = press(method="boxes")
        else:
            # The published models read the contacts of the same simulation.
            scene, published = self.published.predict(self.cover, parameters, turned)
            boxes = scene.boxes
        kept = np.where(array.active, boxes.contact_forces, 0.0)
        forces = {
            "fast": (fast.texel_forces, fast.outside),
            "area": (area.texel_forces, area.outside),
            "boxes": (boxes.texel_forces, boxes.outside),
            "no-spread": (kept, case.load - float(kept.sum())),
            "zeros": (np.zeros(array.count), 0.0),
        }
        return CaseResult(
            case=case,
            reference=reference,
            predictions=predict(reference, forces, case.load, parameters),
            warnings=fast.warnings,
            published=predict(reference, published, case.load, parameters),
        )

    def verify(
        self,
        results: Sequence[CaseResult],  # noqa: ARG002 -- other covers press a case
    ) -> Iterator[tuple[str, Callable[[], Sequence[Check]]]]:
        """Yield the checks of the codes against closed forms on this cover."""
        from validation.credibility.verification import verify_code

        yield "code verification", partial(verify_code, self.cover, self.fast.array)

    def propagate(self, case: Case, inputs: Inputs) -> InputUncertainty:
        """Propagate the uncertain inputs to the image of a case."""
        from validation.credibility.uncertainty import propagate_inputs

        return propagate_inputs(self.cover, self.fast.array, case, inputs)

    def score_stages(self, results: Sequence[CaseResult]) -> StageErrors | None:
        """Score the stages of the fast model; None if it has no tables of the cover."""
        from validation.credibility.stages import score_stages

        return score_stages(self.cover, self.fast, results)

    def classify(self, result: CaseResult) -> Mapping[str, str]:
        """Return load, shape and pose of a case as words."""
        case, outside = result.case, result.reference.outside / result.case.load
        turned = math.degrees(case.pose.yaw) % 90 != 0
        return {
            "load": "below 2 N" if case.load < _HEAVY else "2 N and more",
            "shape": case.shape.split(":")[0],
            "pose": "over an edge" if outside > _AT_EDGE else "turned" if turned else "inside, not turned",
        }

    def measure(self, result: CaseResult) -> Mapping[str, float]:
        """Return load, depth, contact area and the share of the load outside the array."""
        reference, load = result.reference, result.case.load
        return {
            "load_N": load,
            "depth_over_thickness": reference.depth / self.cover.thickness,
            "contact_area_m2": reference.contact_area,
            "share_outside_array": reference.outside / load,
        }


@singledispatch
def plan_cases(
    cover: object, sensor: SensorDescription, cases: Sequence[Case], progress: Callable[[str], None] | None = None
) -> Plan:
    """Find out which presses are missing from the store, and how long the cases take, before anything is derived.

    Each kind of cover registers its own function.

    Args:
        cover: The cover of the sensor.
        sensor: The sensor.
        cases: The cases that will be scored.
        progress: Called with the name of each part.

    Raises:
        TypeError: If no function is registered for the cover.
    """
    del sensor, cases, progress
    raise TypeError(f"no bench is registered for {type(cover).__name__}")


@plan_cases.register(Cover)
def _(
    cover: Cover, sensor: SensorDescription, cases: Sequence[Case], progress: Callable[[str], None] | None = None
) -> Plan:
    del progress
    return plan_solves(cover, sensor.array, cases, friction=sensor.friction)


@singledispatch
def prepare_bench(
    derivation: object,
    cases: Sequence[Case],
    progress: Callable[[str], None] | None = None,
    *,
    parameters: Parameters | None = None,
) -> Bench:
    """Return the bench on which cases are scored; each kind of derivation registers its own.

    Args:
        derivation: What was derived from a sensor.
        cases: The cases that will be scored; nothing may be fitted to them.
        progress: Called with the name of each part.
        parameters: Parameters of the fast model instead of the derived ones; no published model is scored then.

    Raises:
        InputError: If the fast model of the sensor cannot be scored.
        TypeError: If no bench is registered for the derivation.
    """
    del cases, progress, parameters
    raise TypeError(f"no bench is registered for {type(derivation).__name__}")


@prepare_bench.register(LayeredDerivation)
def _(
    derivation: LayeredDerivation,
    cases: Sequence[Case],
    progress: Callable[[str], None] | None = None,
    *,
    parameters: Parameters | None = None,
) -> Bench:
    from validation.published.models import prepare_models

    sensor = derivation.sensor
    cover, friction = sensor.layered_cover, sensor.friction
    if parameters is not None:
        return LayeredBench(cover=cover, fast=parameters, friction=friction)
    if progress:
        progress("fit of the comparison models")
    published = prepare_models(cover, derivation.parameters, cases, friction=friction)
    return LayeredBench(cover=cover, fast=derivation.parameters, friction=friction, published=published)


#: Time of one missing solution by the kind of problem, on one core of a computer of 2020 [s].  `foil` are covers with a
#: layer that is much stiffer than another one; `solid` are faces and other bodies that are not round.
_SECONDS = {
    "small strain": 2.0,
    "finite strain, round": 10.0,
    "finite strain, solid": 25.0,
    "finite strain, solid on foil": 300.0,
    "friction, round": 20.0,
    "friction, solid": 200.0,
}
#: Ratio of the moduli of two layers above which a cover counts as one with a foil [-].
_FOIL = 100.0
#: Time of one case besides the missing solution: fast model, published models, scores [s].
_PER_CASE = 0.7
#: Time of everything besides the cases: fits, verification, uncertainty, the page [s].
_REST = 15.0
#: Seconds per minute, and number of seconds from which minutes are printed.
_MINUTE, _LONG = 60.0, 100.0


@dataclasses.dataclass(frozen=True, kw_only=True)
class Plan:
    """What a campaign has to compute.

    Attributes:
        cases: Number of cases [-].
        missing: Whether the solution of each case is missing from the store; cases that share one count once.
        seconds: Expected time of each case [s].
        rest: Expected time of everything besides the cases [s].
    """

    cases: int
    missing: tuple[bool, ...]
    seconds: tuple[float, ...]
    rest: float = _REST

    @property
    def total(self) -> float:
        """Expected time of the whole evaluation [s]."""
        return sum(self.seconds) + self.rest

    def describe(self) -> str:
        """Say in one line how many solutions are missing and about how long the evaluation takes."""
        count = sum(self.missing)
        what = (
            f"all reference solutions of {self.cases} cases are in the store"
            if not count
            else f"{self.cases} cases, {count} reference solutions missing from the store"
        )
        return f"{what}; about {format_time(self.total)}"


class Clock:
    """Time left of a campaign, from the plan and from the time that the finished cases took."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._started = time.perf_counter()

    def describe(self, done: int, name: str) -> str:
        """Return the name of the next case with the time left.

        Args:
            done: Number of finished cases [-].
            name: Name of the next case.
        """
        expected = sum(self._plan.seconds[:done])
        elapsed = time.perf_counter() - self._started
        # The finished cases tell how fast this computer is; before the first the plan is all there is.
        factor = elapsed / expected if expected else 1.0
        return f"{name}, about {format_time(factor * sum(self._plan.seconds[done:]))} left"


def plan_solves(cover: Cover, array: TexelArray, cases: Sequence[Case], *, friction: float = 0.0) -> Plan:
    """Find out which reference solutions are missing from the store, and how long the cases take.

    Args:
        cover: The cover.
        array: The array.
        cases: The indentations.
        friction: Coulomb friction coefficient between indenter and cover, inf for no slip [-].
    """
    seen: list[Case] = []
    missing, seconds = [], []
    for case in cases:
        absent = find_stored_reference(cover, array, case, friction=friction) is None
        shared = any(_share_solution(cover, case, other) for other in seen)
        seen.append(case)
        missing.append(absent and not shared)
        seconds.append(_PER_CASE + (_SECONDS[classify(cover, case, friction)] if missing[-1] else 0.0))
    return Plan(cases=len(cases), missing=tuple(missing), seconds=tuple(seconds))


def classify(cover: Cover, case: Case, friction: float) -> str:
    """Return the kind of problem that the reference of a case is, a key of the table of times."""
    form = "round" if case.indenter.axisymmetric and not any(case.pose.tilt) else "solid"
    if friction:
        return f"friction, {form}"
    if cover.small_strain_only:
        return "small strain"
    moduli = [layer.material.youngs_modulus for layer in cover.layers]
    foil = " on foil" if form == "solid" and max(moduli) > _FOIL * min(moduli) else ""
    return f"finite strain, {form}{foil}"


def format_time(seconds: float) -> str:
    """Return a time in whole seconds below 100 s, else in whole minutes."""
    return f"{max(seconds, 1):.0f} s" if seconds < _LONG else f"{seconds / _MINUTE:.0f} min"


def _share_solution(cover: Cover, case: Case, other: Case) -> bool:
    """Whether the references of two cases share their solution: the same body and load at two poses of a wide cover."""
    return (
        cover.size is None
        and (case.load, case.path, case.pose.tilt) == (other.load, other.path, other.pose.tilt)
        and case.has_shape_of(other)
    )
