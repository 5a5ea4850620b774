"""Tables of the report on verification, uncertainty, stages, groups and range."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from validation.campaign.evaluation import Evaluation
from validation.credibility.evidence import GROUP_METRICS, Evidence
from validation.credibility.stages import STAGES
from validation.credibility.uncertainty import ComparisonError, InputUncertainty
from validation.credibility.verification import Check, Convergence
from validation.metrics import METRICS
from validation.render.table import Cell, Table, interval, number, tabulate

#: Words for the status of a requirement.
_STATUS = {"met": "met", "missed": "missed", "open": "not decided"}
#: Printed name, unit and factor of each range of the validated domain.
_RANGES = {
    "load_N": ("load", "N", 1.0),
    "depth_over_thickness": ("depth of the indenter over the thickness of the cover", "%", 100.0),
    "contact_area_m2": ("contact area", "mm\u00b2", 1e6),
    "obliquity_rad": ("angle between the motion and the normal of the cover", "\u00b0", math.degrees(1)),
    "share_outside_array": ("share of the load that acts outside the array", "%", 100.0),
}


def evidence_contents(evaluation: Evaluation) -> dict[str, Any]:
    """Return the variables of the sections on evidence for the page's template."""
    evidence = evaluation.evidence
    return {
        "requirements": _tabulate_requirements(evaluation),
        "codes": tabulate(
            "codes",
            "Code verification: error against closed forms or a finer mesh on three grids, computed for this report",
            evidence.checks,
            Check,
            ("name", "errors", "order", "result", "passed"),
        ),
        "solutions": tabulate(
            "solutions",
            "Solution verification: the reference on three grids",
            evidence.convergence,
            Convergence,
            ("case", "values", "result", "order", "estimate"),
        ),
        "errors": tabulate(
            "errors-table",
            "Comparison error E = S - D of the fast model S against the reference D, and validation uncertainty",
            evidence.errors,
            ComparisonError,
            ("case", "fast", "reference", "error", "u_num", "u_input", "u_data", "u_val", "resolved_here", "resolved"),
        ),
        "inputs": _tabulate_inputs(evidence),
        "stages": _tabulate_stages(evidence),
        "groups": _tabulate_groups(evidence),
        "domain": _tabulate_domain(evidence),
        "input_list": _list_inputs(evidence),
        "resolved": _count_resolved(evidence),
        "notes": sorted({each.note for each in evidence.inputs.values() if each.note}),
        "limits": _name_limits(evidence),
        "failed": evidence.failed,
        "left_out": evidence.left_out,
    }


def _tabulate_requirements(evaluation: Evaluation) -> Table:
    rows = []
    for each in evaluation.verdict.findings:
        metric = METRICS[each.metric]
        name, unit, factor = metric.heading, metric.unit, metric.factor
        ends = "" if each.low == each.high else f"{factor * each.low:.3g} to {factor * each.high:.3g} {unit}".strip()
        limit = f"{factor * each.limit:.3g} {unit}".strip()
        rows.append(
            [
                Cell(text=name, small=each.over),
                number(each.value, factor, small=ends, unit=unit),
                Cell(text=limit, value=each.limit),
                Cell(text=_STATUS[each.status], bold=each.status != "met"),
            ]
        )
    return Table(
        name="requirements",
        caption="Acceptance criterion: every requirement, what was found, and whether it is met",
        headings=("requirement", "found (95 % interval)", "at most", "status"),
        rows=rows,
        texts=(3,),
    )


def _tabulate_inputs(evidence: Evidence) -> Table:
    names = list(dict.fromkeys(name for each in evidence.inputs.values() for name in each.misplaced))
    rows = [
        [
            Cell(text=case),
            *(number(each.misplaced.get(name), 100, 2) for name in names),
            number(each.misplaced_total, 100, 2),
        ]
        for case, each in evidence.inputs.items()
    ]
    return Table(
        name="inputs",
        caption="Input uncertainty: misplaced force [% of the load] by one standard uncertainty of each input, and all",
        headings=("case", *(name.split(" [")[0] for name in names), "all, in quadrature"),
        rows=rows,
    )


def _tabulate_stages(evidence: Evidence) -> Table | None:
    stages = evidence.stages
    if stages is None:
        return None
    metric = METRICS["misplaced_force"]
    rows = [
        [Cell(text=stage, small=what), interval(stages.pooled[stage], metric), _largest(stages.cases, stage)]
        for stage, what in STAGES.items()
    ]
    return Table(
        name="stages",
        caption="Score by stage: misplaced force [% of the load] when one part of the reference is replaced",
        headings=("stage", "mean over the cases", "largest"),
        rows=rows,
    )


def _largest(cases: Any, stage: str) -> Cell:  # noqa: ANN401 -- nested mapping
    name = max(cases, key=lambda case: cases[case][stage])
    return number(cases[name][stage], 100, 2, small=name)


def _tabulate_groups(evidence: Evidence) -> Table:
    rows = [
        [
            Cell(text=member, small=group),
            Cell(text=str(metrics[GROUP_METRICS[0]].cases), value=metrics[GROUP_METRICS[0]].cases),
            *(interval(metrics[name], METRICS[name]) for name in GROUP_METRICS),
        ]
        for group, members in evidence.groups.items()
        for member, metrics in members.items()
    ]
    return Table(
        name="groups",
        caption=f"Error of the fast model by {_join(list(evidence.groups))}: means and 95 % intervals",
        headings=("group", "cases", *(METRICS[name].title for name in GROUP_METRICS)),
        rows=rows,
    )


def _join(names: list[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _tabulate_domain(evidence: Evidence) -> Table:
    rows = [
        [
            Cell(text=f"{_RANGES[name][0]} [{_RANGES[name][1]}]"),
            *(number(end, _RANGES[name][2]) for end in ends),
        ]
        for name, ends in evidence.domain.items()
    ]
    return Table(
        name="domain",
        caption="Range of the cases, where the validated domain ends",
        headings=("quantity", "smallest", "largest"),
        rows=rows,
    )


def _list_inputs(evidence: Evidence) -> list[str]:
    """Describe the standard uncertainties of the inputs of the first case."""
    first: InputUncertainty | None = next(iter(evidence.inputs.values()), None)
    if first is None:
        return []
    units = {"relative": (100.0, " %"), "m": (1e3, " mm"), "rad": (math.degrees(1), "°"), "-": (1.0, "")}
    out = []
    for name, value in first.uncertainties.items():
        what, _, unit = name.removesuffix("]").partition(" [")
        if not unit:
            bound = "no slip" if math.isinf(value) else f"a coefficient of {value:g}"
            out.append(f"{what} uniform from none to {bound}")
            continue
        factor, text = units[unit]
        out.append(f"{what} {factor * value:.3g}{text}")
    return out


def _count_resolved(evidence: Evidence) -> dict[str, int]:
    return {
        "all": len(evidence.errors),
        "here": sum(each.resolved_here for each in evidence.errors),
        "real": sum(each.resolved for each in evidence.errors),
    }


def _name_limits(evidence: Evidence) -> dict[str, Any]:
    """Say which stage of the model has the largest error, and how much the electronics hide."""
    stages = evidence.stages
    if stages is None:
        return {}
    model = {name: each.mean for name, each in stages.pooled.items() if name != "electronics" and each.cases}
    largest = max(model, key=lambda name: model[name])
    inputs = [each.misplaced_total for each in evidence.inputs.values()]
    return {
        "stage": largest,
        "error": 100 * model[largest],
        "hidden": 100 * stages.pooled["electronics"].mean,
        "inputs": 100 * float(np.mean(inputs)) if inputs else math.nan,
    }
