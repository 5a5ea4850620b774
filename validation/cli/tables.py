"""Tables and tactile images for the terminal."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from rich.table import Table
from rich.text import Text

from meshes import Cover, TexelArray
from validation.calibration.stamp import StampScores
from validation.campaign.comparison import Comparison
from validation.campaign.pooling import Pooled
from validation.campaign.run import CampaignResult
from validation.derivation.derive import Derivation

FloatArray = npt.NDArray[np.float64]

#: Characters of a texel in a tactile image, and between two images.
_CELL, _GAP = 6, 3


def cover_text(cover: Cover) -> str:
    """The cover in one line, with its label where it is assumed."""
    layers = " + ".join(
        f"{1e3 * layer.thickness:.4g} mm {layer.material.name} "
        f"(E {layer.material.youngs_modulus / 1e6:.4g} MPa, nu {layer.material.poisson_ratio:.4g})"
        for layer in cover.layers
    )
    if cover.size is not None:
        layers += ", {:.4g} x {:.4g} mm, free side edges".format(*(1e3 * edge for edge in cover.size))
    return f"ASSUMED: {layers}" if cover.assumed else layers


def derivation_table(derivation: Derivation) -> Table:
    """What was derived."""
    sensor, fit = derivation.sensor, derivation.fit
    errors = derivation.error_estimate
    table = Table(title=f"Point spread function of {sensor.name}", show_header=False)
    table.add_column(no_wrap=True)
    table.add_column()
    gaussian = fit.gaussian
    rows = (
        ("cover", cover_text(sensor.cover)),
        ("sigma x, y", f"{gaussian.sigma_x:.4f}, {gaussian.sigma_y:.4f} pitches ({fit.estimator})"),
        ("ksize x, y", f"{gaussian.ksize_x}, {gaussian.ksize_y} texels"),
        ("residual", f"{100 * fit.residual:.2f} % of the load on the wrong texel"),
        ("outside kernel", f"{100 * fit.outside_kernel:.2f} % of the load"),
        *_everywhere_alike(derivation),
        ("sigma / Young's modulus", _modulus_text(sensor.cover)),
        *_depth_rows(derivation),
        ("error estimate", ", ".join(f"{name} {100 * value:.2g} %" for name, value in errors.items())),
        ("time", f"{derivation.seconds:.2f} s"),
        *(("not determined" if not k else "", line) for k, line in enumerate(derivation.undetermined)),
    )
    for name, value in rows:
        table.add_row(name, value)
    return table


def _depth_rows(derivation: Derivation) -> tuple[tuple[str, str], ...]:
    """What depths under a ball say."""
    if derivation.depth is None:
        return ()
    foundation, contact = derivation.depth.foundation, derivation.depth.contact
    modulus = f"{1e-9 * foundation.modulus:.3g} +- {1e-9 * foundation.uncertainty:.2g} N/mm3"
    softness = f"solref {contact.solref[0]:.3g} s, 1; impedance {contact.solimp[0]:.4f}"
    return (
        ("foundation modulus", f"{modulus} ({foundation.estimator})"),
        ("MuJoCo's plate", f"{softness}: {1e3 * contact.depth:.3g} mm under {1e3 * contact.mass:.3g} g"),
    )


def _modulus_text(cover: Cover) -> str:
    return "none: it drops out" + ("" if len(cover.layers) == 1 else ", only the ratio of the layers' moduli counts")


def _everywhere_alike(derivation: Derivation) -> tuple[tuple[str, str], ...]:
    """What there is to say of a wide cover only."""
    base, texels = derivation.resolution, derivation.resolution_on_array
    if base is None or texels is None:
        return (("side edges", "free: the spread differs from place to place; sigma is that of the middle texel"),)
    return (
        ("resolution", f"{_length(base)} at the base"),
        ("", f"{_length(texels)} with these texels, worst alignment"),
        ("sigma / thickness", f"{derivation.sensitivity['thickness'] * 1e-3:+.3f} pitches per mm"),
        ("sigma / Poisson ratio", f"{derivation.sensitivity['poisson_ratio'] * 0.01:+.4f} pitches per 0.01"),
    )


def estimates_table(derivation: Derivation) -> Table:
    """Every estimator's sigma."""
    table = Table(title="Sigma by estimator [pitches]".replace("[", "\\["))
    for heading in ("estimator", "x", "y"):
        table.add_column(heading, justify="left" if heading == "estimator" else "right")
    used = derivation.fit.estimator
    for name, pair in sorted(derivation.fit.estimates.items(), key=lambda item: item[0] != used):
        table.add_row(
            f"{name} (used)" if name == used else name,
            *("none" if math.isnan(value) else f"{value:.4f}" for value in pair),
        )
    return table


def heat_maps(array: TexelArray, images: Sequence[tuple[str, FloatArray]], *, width: int = 80) -> Table:
    """Tactile images on one scale, in mN, row 0 at the bottom: side by side where the width [characters] allows."""
    peak = max(float(np.max(np.abs(values))) for _, values in images) or 1.0
    table = Table.grid(padding=(0, _GAP))
    titles = [Text(f"{title}, mN", style="bold") for title, _ in images]
    maps = [_heat_map(array, values, peak) for _, values in images]
    if len(images) * (_CELL * array.columns + _GAP) <= width:
        for _ in images:
            table.add_column(no_wrap=True)
        table.add_row(*titles)
        table.add_row(*maps)
    else:
        table.add_column(no_wrap=True)
        for title, drawn in zip(titles, maps, strict=True):
            table.add_row(title)
            table.add_row(drawn)
    return table


def _heat_map(array: TexelArray, values: FloatArray, peak: float) -> Text:
    text = Text()
    image, active = array.image(values), array.image(array.active)
    for row in range(array.rows - 1, -1, -1):
        for column in range(array.columns):
            value = float(image[row, column])
            if active[row, column]:
                text.append(f"{round(1e3 * value):{_CELL}d}", style=_style(value / peak))
            else:
                text.append(" " * _CELL)
        text.append("\n")
    return text


def _style(share: float) -> str:
    if share < 0:
        return "white on rgb(30,50,110)"
    level = min(1.0, math.sqrt(share))
    red, green, blue = (round(255 * part) for part in (level, 0.72 * level**1.5, 0.25 * level**3))
    return f"{'black' if level > 0.75 else 'white'} on rgb({red},{green},{blue})"  # noqa: PLR2004 -- legibility


def _length(value: float) -> str:
    return "none" if math.isnan(value) else f"{1e3 * value:.2f} mm"


def _force(value: float) -> str:
    return f"{round(value, 4) + 0.0:.4f} N"  # no minus before a zero


def comparison_table(comparison: Comparison) -> Table:
    """Totals of each model and, where both are there, the scores."""
    table = Table(show_header=False)
    table.add_column(no_wrap=True)
    table.add_column()
    fem, fast = comparison.fem, comparison.fast
    if fem is not None and "fem" in comparison.models:
        errors = ", ".join(f"{name} {100 * value:.2g} %" for name, value in fem.error_estimate.items())
        assumed = ", ".join(f"{name}: {value}" for name, value in fem.assumptions.items())
        table.add_row("finite elements", f"{fem.total_force:.4f} N, {_force(fem.outside)} of it outside the array")
        table.add_row("", f"depth {1e3 * fem.depth:.4f} mm, contact area {1e6 * fem.contact_area:.3f} mm²")
        table.add_row("", f"error estimate {errors}")
        table.add_row("", f"assumes {assumed}; {fem.seconds:.2f} s")
    if fast is not None:
        table.add_row("fast model", f"{fast.total_force:.4f} N, {_force(fast.outside)} of it outside the array")
        table.add_row("", f"{fast.seconds:.3f} s")
    if comparison.score is not None:
        table.add_section()
        for name, value in comparison.score.as_json().items():
            table.add_row(name, "none" if value is None else f"{value:.4g}")
    return table


def campaign_table(campaign: CampaignResult) -> Table:
    """Means over cases with their intervals, by model."""
    floor = campaign.noise_floor
    table = Table(
        title=f"Against finite elements: {len(campaign.cases)} cases, means and 95 % intervals over cases",
        caption=f"error estimate of the reference: total force {100 * floor['total_force']:.2g} %, "
        f"peak texel {100 * floor['peak_texel']:.2g} %",
    )
    columns = (
        ("misplaced force", "misplaced_force", 100, " %"),
        ("relative L2", "relative_l2", 100, " %"),
        ("total force", "total_force_error", 100, " %"),
        ("centre", "centre_of_pressure_m", 1e3, " mm"),
        ("image changed", "image_changed_percent", 1, " %"),
    )
    table.add_column("model", no_wrap=True)
    for heading, *_ in columns:
        table.add_column(heading, justify="right", overflow="fold")
    for model, metrics in campaign.pooled.items():
        table.add_row(model, *(_pooled(metrics[name], factor, unit) for _, name, factor, unit in columns))
    return table


def recordings_table(scores: StampScores) -> Table:
    """Image changed of every model on recordings that were not fitted, by split."""
    splits = list(dict.fromkeys(row.split for row in scores.rows))
    table = Table(title="Against recordings: image changed [%] on weights that were not fitted".replace("[", "\\["))
    table.add_column("model", no_wrap=True)
    for split in splits:
        table.add_column(scores.about[split], justify="right")
    names = dict.fromkeys((row.model, row.texel_gains, row.kind) for row in scores.rows)
    for model, gains, kind in names:
        cells = []
        for split in splits:
            row = next((r for r in scores.rows if (r.split, r.model, r.texel_gains) == (split, model, gains)), None)
            cells.append("" if row is None else f"{row.pooled['image_changed_percent'].mean:.2f}")
        label = {"null": " (null)", "floor": " (floor)"}.get(kind, " + texel gains" if gains else "")
        table.add_row(f"{model}{label}", *cells)
    return table


def _pooled(value: Pooled, factor: float, unit: str) -> str:
    if not value.cases:
        return "none"
    return f"{factor * value.mean:.3g}{unit}\n[dim]{factor * value.low:.2g}..{factor * value.high:.2g}[/dim]"
