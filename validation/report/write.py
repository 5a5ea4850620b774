"""Writing of the report folder: `index.html`, the page's assets, `report.json`, `parameters.toml` and `cover.npz`."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from validation.campaign.evaluation import Evaluation
from validation.curved.derive import CurvedDerivation
from validation.extras import REPORT_MODULES, require
from validation.json_values import json_text
from validation.report.contents import contents
from validation.report.curved import draw_cases

#: Files of the report's page that are copied unchanged.
_ASSETS = ("report.css", "report.js")


def write_report(evaluation: Evaluation, folder: Path) -> None:
    """Write the report on a sensor's evaluation.

    Args:
        evaluation: The results to show.
        folder: An existing folder to write to.

    Raises:
        MissingExtraError: If jinja2 or plotly is not installed.
        OSError: If the folder cannot be written.
    """
    require(*REPORT_MODULES)
    from jinja2 import Environment, PackageLoader, StrictUndefined

    assets = resources.files("validation.report").joinpath("assets")
    environment = Environment(
        loader=PackageLoader("validation.report", "assets"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    template = environment.get_template("index.html.j2")
    pictures = draw_cases(evaluation, folder) if isinstance(evaluation.derivation, CurvedDerivation) else None
    (folder / "index.html").write_text(template.render(contents(evaluation, pictures)), encoding="utf-8")
    for name in _ASSETS:
        (folder / name).write_bytes(assets.joinpath(name).read_bytes())
    plotly = resources.files("plotly").joinpath("package_data", "plotly.min.js")
    (folder / "plotly.min.js").write_bytes(plotly.read_bytes())
    (folder / "report.json").write_text(json_text(evaluation.report), encoding="utf-8")
    evaluation.derivation.parameters.save(folder)
