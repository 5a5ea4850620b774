"""Contents of the report's table of comparison models: our own, the null models and all published ones."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from validation.campaign.results import MODELS, SKILL_METRICS, CampaignResult, Pooled, RowScores
from validation.metrics import METRICS
from validation.render.table import Cell, Table, interval

#: Metrics of the table.
_METRICS = (*SKILL_METRICS, "centre_of_pressure_m")
#: Our rows and the null models, with what they take the texel forces from and what was fitted.
_OWN = {
    "fast": ("cover's own cells", "nothing: cover data by finite elements"),
    "area": ("engine's contact points", "sigma, on a uniform load on one texel"),
    "boxes": ("engine's contact points", "sigma, on a uniform load on one texel"),
    "no-spread": ("engine's contact points", "nothing"),
    "zeros": ("nothing", "nothing"),
}
#: Metrics in the sentence about models that are as good as the fast model.
_NAMES = {
    "misplaced_force": "misplaced force",
    "image_changed_percent": "image changed",
    "image_changed_line_percent": "image changed after the WTS line",
}


def comparison_contents(campaign: CampaignResult) -> dict[str, Any] | None:
    """Return the variables of the table for the page's template; None if no published model was scored.

    Args:
        campaign: The scores.
    """
    if not campaign.published:
        return None
    rows = [_own_row(name, campaign.pooled[name]) for name in MODELS]
    rows += [_published_row(scores) for scores in campaign.published]
    table = Table(
        name="comparison-table",
        caption="Published models, our own and the null models in the same cases under the same loads: means and 95 % "
        "intervals",
        headings=("model", "parameters and fit", *(METRICS[name].title for name in _METRICS)),
        rows=[_make_cells(row) for row in rows],
        texts=(1,),
    )
    presses = next((scores.fitted_on for scores in campaign.published if scores.fitted_on), ())
    return {
        "table": table,
        "rows": rows,
        "presses": presses,
        "as_good": [(_NAMES[metric], _name_as_good(campaign, metric)) for metric in SKILL_METRICS],
        "not_built": {scores.title: scores.not_built for scores in campaign.published if scores.not_built},
    }


def _make_cells(row: Mapping[str, Any]) -> list[Cell]:
    details = "; ".join(
        text
        for text in (
            row["contact"],
            row["rule"],
            row["certainty"] and f"sure of it: {row['certainty']}",
            row["total"] and f"sum: {row['total']}",
        )
        if text
    )
    name = f"{row['title']}, {row['variant']}" if row["variant"] else row["title"]
    return [
        Cell(text=name, small=details),
        Cell(text=row["parameters"] or "\u2013", small=f"fitted: {row['fitted']}"),
        *(interval(row["pooled"][metric], METRICS[metric]) for metric in _METRICS),
    ]


def _own_row(name: str, pooled: Mapping[str, Pooled]) -> dict[str, Any]:
    contact, fitted = _OWN[name]
    kind = "null model" if MODELS[name].startswith("null") else "ours"
    if name == "boxes":
        kind = "the 2015 report's form"
    return {
        "title": f"{name} ({kind})",
        "variant": "",
        "contact": contact,
        "rule": MODELS[name],
        "parameters": "",
        "fitted": fitted,
        "certainty": "",
        "total": "",
        "pooled": pooled,
    }


def _published_row(scores: RowScores) -> dict[str, Any]:
    values = (
        f"{name.replace('_', ' ')} {value:.3g} {scores.units.get(name, '')}"
        for name, value in scores.parameters.items()
    )
    fitted = ", ".join(name.replace("_", " ") for name in scores.fitted)
    return {
        "title": scores.title,
        "variant": scores.variant,
        "contact": scores.contact,
        "rule": scores.rule,
        "parameters": ", ".join(value.strip() for value in values),
        "fitted": f"{fitted}, on {len(scores.fitted_on)} presses" if fitted else "nothing",
        "certainty": scores.certainty,
        "total": scores.total if scores.total != "the load" else "",
        "pooled": scores.pooled,
    }


def _name_as_good(campaign: CampaignResult, metric: str) -> list[str]:
    """Name the models that the cases do not tell from the fast model, and those that are better, by a metric."""
    found = []
    for scores in campaign.published:
        skill = scores.skill[metric]
        if skill.high < 0 or skill.low <= 0:
            word = "better" if skill.high < 0 else "not told apart"
            found.append(f"{scores.title} {scores.variant} ({word})")
    return found
