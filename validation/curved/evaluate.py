"""The whole evaluation of a sensor with a curved cover: responses, fast model, campaign, verification."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from validation.campaign.campaign_file import Campaign
from validation.campaign.evaluation import Evaluation, Progress, versions
from validation.campaign.verdict import judge
from validation.curved.campaign import CurvedCampaign, plan_presses
from validation.curved.derive import derive_curved
from validation.curved.evidence import gather_curved_evidence
from validation.curved.press import make_meshes
from validation.sensor_file import SensorDescription


def evaluate_curved(
    sensor: SensorDescription,
    campaign: Campaign,
    *,
    progress: Progress | None = None,
    announce: Callable[[str], None] | None = None,
) -> Evaluation:
    """Derive the responses and the fast model of a curved cover, and score the fast model in a campaign.

    Args:
        sensor: A sensor with a curved cover.
        campaign: Cases, intended use and acceptance criterion.
        progress: Display of progress.
        announce: Called once, before the long computations, with a line about what is missing and how long it takes.

    Raises:
        InputError: If the cover cannot be meshed, or its meshes are too fine for the fast model.
        KeyboardInterrupt: If interrupted before a case is finished; after that the finished cases are returned.
        ConvergenceError: If the finite-element solver did not converge.
    """
    clock = [time.perf_counter()]
    meshes = make_meshes(sensor, progress)
    plan = plan_presses(sensor, meshes, campaign.cases)
    if announce:
        announce(plan.describe())
    derivation = derive_curved(sensor, progress=progress)
    if progress:
        progress("fast model, compliance of the surface")
    bench = CurvedCampaign(derivation=derivation, meshes=meshes)
    bench.require_fast_model()
    clock.append(time.perf_counter())
    result = bench.run(campaign.cases, plan, progress.step if progress else None)
    evidence = gather_curved_evidence(sensor, meshes, result, progress)
    clock.append(time.perf_counter())
    return Evaluation(
        derivation=derivation,
        verification={},
        plan=campaign,
        campaign=result,
        verdict=judge(campaign, result),
        evidence=evidence,
        recordings=None,
        recorded=sensor,
        seconds=dict(zip(("derive", "campaign"), np.diff(clock).tolist(), strict=True)),
        versions=versions(),
    )
