"""The whole evaluation of a sensor: derivation of its fast model, and scores of the fast model and of recordings.

The fast model is scored against finite elements in a campaign, a list of indentations (cases), and against recordings
of a real sensor if there are any.
"""

from __future__ import annotations

import dataclasses
import platform
import time
from collections.abc import Callable, Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from validation.campaign.bench import LayeredBench, prepare_bench
from validation.campaign.campaign_file import Campaign, Inputs, read_campaign
from validation.campaign.case import Case
from validation.campaign.plan import Budget, plan_cases
from validation.campaign.results import CampaignResult, SkippedCase
from validation.campaign.run import run_campaign
from validation.campaign.solid_bench import SolidBench
from validation.credibility.evidence import Evidence, gather_evidence
from validation.derivation.derive import Derivation, derive
from validation.errors import at
from validation.moving.results import MovingResult
from validation.moving.run import Moved, run_moving
from validation.places import find_places
from validation.sensor_file import SensorDescription
from validation.text.friction import describe_friction
from validation.verdict import Verdict, judge

if TYPE_CHECKING:
    from validation.data_sets.data_set import DataSet
    from validation.data_sets.results import RecordingScores
    from validation.results.report import RecordingReport, Report


#: Benches of the kinds of covers.  Their modules register functions that read, plan and score cases.
KINDS = (LayeredBench, SolidBench)


class Progress(Protocol):
    """Interface of a display that shows the progress of a long computation."""

    def __call__(self, stage: str) -> None:
        """Begin a stage of the work with the name `stage`."""

    def step(self, done: int, total: int, name: str) -> None:
        """Show that `done` of `total` steps are finished, and that step `name` is next."""


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class RecordingEvaluation:
    """Scores of a sensor's fast model on recordings, which the report shows.

    Attributes:
        verdict: Whether the fast model meets the acceptance criterion.
        recordings: Scores of the fast model against recordings, or None without recordings.
        recorded: Sensor that made the recordings.
        seconds: Wall time by stage [s].
        versions: Versions of the software by name.
    """

    verdict: Verdict
    recordings: RecordingScores | None
    recorded: SensorDescription
    seconds: Mapping[str, float]
    versions: Mapping[str, str]

    @property
    def sensor(self) -> SensorDescription:
        """The sensor that was evaluated."""
        return self.recorded

    @property
    def report(self) -> RecordingReport:
        """Content of `report.json`, with all numbers of the page."""
        from validation.results.report import RecordingReport

        return RecordingReport(**self._report)

    @property
    def _report(self) -> dict[str, Any]:
        cover = self.sensor.cover
        own = {name: getattr(self, name) for name in ("verdict", "recordings", "seconds", "versions")}
        return own | {"sensor": self.sensor.name, "cover_assumed": cover.assumed}


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Evaluation(RecordingEvaluation):
    """Results of the evaluation of a sensor, which the report shows.

    Attributes:
        derivation: Point spread function of the cover, fitted kernel and parameters of the fast model.  For a curved
            cover, the responses of its texels.
        verification: Differences between the finite elements and the closed-form layer solution: `radial_profile` is
            the largest difference of base pressure under a point load over the peak pressure, `texel_response` the
            difference of the force on the loaded texel over the load [-].  Empty on a curved cover.
        plan: The campaign as its file describes it: cases, intended use and acceptance criterion.
        campaign: Scores of the fast model against the finite elements.
        evidence: Verification, effect of uncertain inputs, error of each stage, and range of the cases.
        moving: Results of the cases that change in time.
        not_moved: Those of these cases that have no scores.
    """

    derivation: Derivation
    verification: Mapping[str, float]
    plan: Campaign
    campaign: CampaignResult
    evidence: Evidence
    moving: tuple[MovingResult, ...] = ()
    not_moved: tuple[SkippedCase, ...] = ()

    @property
    def sensor(self) -> SensorDescription:
        """The sensor that was evaluated."""
        return self.derivation.sensor

    @property
    def report(self) -> Report:
        """Content of `report.json`, with all numbers of the page."""
        from validation.results.report import Report

        return Report(
            **self._report,
            campaign_file=self.plan.as_json(),
            friction=describe_friction(self.sensor.friction),
            derive=self.derivation.result,
            verification=self.verification,
            campaign=self.campaign,
            evidence=self.evidence,
            moving=self.moving,
            not_moved=self.not_moved,
        )


def evaluate(
    sensor: SensorDescription,
    *,
    recordings: DataSet | None = None,
    recorded: SensorDescription | None = None,
    campaign: Campaign | None = None,
    cases: Sequence[Case] | None = None,
    budget: Budget | None = None,
    progress: Progress | None = None,
    announce: Callable[[str], None] | None = None,
) -> Evaluation:
    """Derive the parameters of a sensor's fast model, and score the fast model in a campaign (a list of indentations).

    The spread kernel is fitted to the response to one loaded texel before any case is computed, and then kept.

    Args:
        sensor: Array, cover and electronics of the sensor, and friction for the finite elements of the campaign.
        recordings: Recordings under known loads; None for none.
        recorded: Sensor that made the recordings; `sensor` if None.
        campaign: Cases, intended use and acceptance criterion; the default campaign if None.
        cases: Indentations that replace those of the campaign; None for those of the campaign.
        budget: Time that the evaluation may take; the cases that tell most are chosen.  None for all cases.
        progress: Display of progress.
        announce: Function that is called once, before the long computations, with a line about the missing solutions
            and their computing time.

    Raises:
        InputError: If the sensor cannot be evaluated, or the budget is below one case.
        KeyboardInterrupt: If interrupted before a case is finished; after that the finished cases are returned.
        RecordingError: If the recordings are damaged or from another array.
        ConvergenceError: If the finite-element solver did not converge.
    """
    plan = campaign or read_plan(None, sensor, progress)
    clock = [time.perf_counter()]
    # Recordings are scored first, so that a fault in them is reported before the long computations.
    scores = None if recordings is None else _score_recordings(recordings, recorded or sensor, plan.inputs, progress)
    clock.append(time.perf_counter())
    plan = plan if cases is None else dataclasses.replace(plan, cases=tuple(cases))
    with at(f"{sensor.source}: "):
        cost = plan_cases(sensor.cover, sensor.array, plan.cases, friction=sensor.friction)
        if budget is not None:
            plan = budget.shorten(plan, cost)
        listed = (*plan.cases, *plan.spare)
        cost = cost if budget is None else plan_cases(sensor.cover, sensor.array, listed, friction=sensor.friction)
    if announce:
        announce(cost.describe(budget, len(plan.spare)))
    derivation = derive(sensor, progress=progress)
    clock.append(time.perf_counter())
    bench = prepare_bench(derivation, [*listed, *(each.heaviest for each in plan.moving)], progress)
    step = progress.step if progress else None
    result = run_campaign(bench, listed, plan=cost, budget=budget, spare=len(plan.spare), progress=step)
    done = {each.case.name for each in result.cases} | {each.name for each in result.skipped}
    plan = dataclasses.replace(
        plan, cases=tuple(case for case in listed if case.name in done or case in plan.cases),
        spare=tuple(case for case in plan.spare if case.name not in done),
    )  # fmt: skip
    moved = Moved()
    if plan.moving and not result.interrupted:
        if progress:
            progress("moving cases")
        moved = run_moving(bench, plan.moving, step, budget=budget)
        result = dataclasses.replace(result, interrupted=moved.interrupted)
    evidence = gather_evidence(bench, plan, result, progress, budget=budget)
    clock.append(time.perf_counter())
    return Evaluation(
        derivation=derivation,
        verification=derivation.verification,
        plan=plan,
        campaign=result,
        # Recordings of another sensor are shown, and tell nothing about this one.
        verdict=_judge(plan, result, scores, recordings if recorded is None or recorded is sensor else None),
        evidence=evidence,
        moving=moved.results,
        not_moved=moved.skipped,
        recordings=scores,
        recorded=recorded or sensor,
        seconds=dict(zip(("recordings", "derive", "campaign"), np.diff(clock).tolist(), strict=True)),
        versions=versions(),
    )


def evaluate_recordings(
    sensor: SensorDescription, recordings: DataSet, *, campaign: Campaign, progress: Progress | None = None
) -> RecordingEvaluation:
    """Score the fast model of a sensor on recordings alone, without finite elements.

    Args:
        sensor: The sensor that made the recordings.
        recordings: Recordings under known loads.
        campaign: Campaign whose requirements on recordings hold where the data set states none.
        progress: Display of progress.

    Raises:
        InputError: If no recording or no split can be used.
        RecordingError: If the recordings are damaged or from another array.
    """
    start = time.perf_counter()
    scores = _score_recordings(recordings, sensor, campaign.inputs, progress)
    return RecordingEvaluation(
        verdict=_judge(campaign, None, scores, recordings),
        recordings=scores,
        recorded=sensor,
        seconds={"recordings": time.perf_counter() - start},
        versions=versions(),
    )


def _judge(
    plan: Campaign, result: CampaignResult | None, scores: RecordingScores | None, data_set: DataSet | None
) -> Verdict:
    if data_set is None:
        return judge(plan, result)
    splits = [each.name for each in data_set.splits or ()]
    return judge(plan, result, scores, required=data_set.required, splits=splits)


def _score_recordings(
    data_set: DataSet, recorded: SensorDescription, inputs: Inputs, progress: Progress | None
) -> RecordingScores:
    """Score the fast model of the sensor that made the recordings, with its parameters derived or from the package."""
    import fastmodel
    from validation.data_sets.score import score_recordings
    from validation.sensor_file import BUILT_IN

    built_in = recorded is BUILT_IN.get(recorded.name)
    parameters = fastmodel.load(recorded.name) if built_in else derive(recorded, progress=progress).parameters
    return score_recordings(data_set, recorded, parameters, inputs=inputs, progress=progress)


def read_plan(path: Path | None, sensor: SensorDescription, progress: Progress | None = None) -> Campaign:
    """Read a campaign file, or the default campaign for the kind of cover.

    Args:
        path: The file; None for the default campaign.
        sensor: The sensor, which defines the named places.
        progress: Display of progress.

    Raises:
        InputError: As for `read_campaign`.
    """
    return read_campaign(path, find_places(sensor.cover, sensor, progress))


def versions() -> dict[str, str]:
    """Return the versions of this package, of Python and of the numerical libraries, by name."""
    names = ("softcover", "numpy", "scipy", "mujoco", "scikit-fem")
    return {name: metadata.version(name) for name in names} | {"python": platform.python_version()}
