"""The command `softcover derive`, which computes the parameters of a sensor's fast model by finite elements."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from validation.cli.entry import DONE
from validation.cli.meaning import explain_derivation
from validation.cli.options import Json, Layers, MaterialName, SensorFile, Thickness
from validation.cli.output import (
    Progress,
    describe_cover,
    describe_errors,
    make_console,
    print_json,
    print_meaning,
    print_rows,
    print_table,
    say,
)

if TYPE_CHECKING:
    from fastmodel import Fit, Validity
    from validation.derivation.derive import Derivation
    from validation.sensor_file import SensorDescription

_Format = Annotated[Literal["png", "svg"], Parameter(help="Format of the picture.")]
_Out = Annotated[Path | None, Parameter(help="Folder for the files; an earlier result is replaced.")]


def derive(
    sensor: SensorFile,
    *,
    material: MaterialName = None,
    thickness: Thickness = None,
    layer: Layers = None,
    out: _Out = None,
    format: _Format = "png",  # noqa: A002 -- the option's name
    json: Json = False,
) -> int:
    """Compute the point spread function of a sensor's cover, and fit the fast model's parameters to it.

    Prints sigma and ksize of the Gaussian kernel and the share of the load that the kernel puts on wrong texels; sigma
    by every other estimator; the two-point resolution, which is the smallest distance of two equal loads with a dip
    between them, at the cover's base and in the texel values; the change of sigma with thickness and Poisson ratio; and
    the error estimate of the finite elements.

    Young's modulus has no effect on the point spread function: a softer cover of the same thickness and Poisson ratio
    spreads a given pressure just as far.  With several layers, the ratios of their moduli have an effect.  The modulus
    determines the depth and the contact area of an indenter: see `softcover press`.

    Examples of use:

        softcover derive wts-0614-34
        softcover derive sensor.toml --out derived
        softcover derive wts-0614-34 --material dragon-skin-30 --thickness 3mm --json
        softcover derive fingertip --out fingertip
    """
    from meshes import SolidCover
    from validation.cli.options import read_description
    from validation.output_folder import new_folder

    description = read_description(sensor, material=material, thickness=thickness, layers=layer, curved=True)
    _require_modules(description, pictures=out is not None)
    if isinstance(description.cover, SolidCover):
        from validation.cli.curved.derive import derive_curved_cover

        return derive_curved_cover(description, out, json=json)
    from validation.derivation.derive import derive_layers

    files: tuple[str, ...] = ()
    with contextlib.ExitStack() as stack:
        folder = stack.enter_context(new_folder(out)) if out else None
        with Progress() as progress:
            derivation = derive_layers(description, progress=progress)
        if folder:
            from validation.report.derivation import write_derivation

            files = write_derivation(derivation, folder, format)
    if json:
        print_json(derivation.result.as_json())
    else:
        print_rows(_list_results(derivation), title=f"Point spread function of {description.name}")
        print_table(("estimator", "x", "y"), _list_estimates(derivation.fit), title="Sigma by estimator [pitches]")
        _draw_response(derivation)
        print_meaning(explain_derivation(derivation))
    if out:
        say(f"wrote {', '.join(files)} to {out}")
    return DONE


def _require_modules(sensor: SensorDescription, *, pictures: bool) -> None:
    """Check that finite elements are installed.

    Raises:
        MissingExtraError: If they are not.
    """
    from meshes import SolidCover
    from validation.extras import require
    from validation.sensor_file import BUILT_IN

    if not isinstance(sensor.cover, SolidCover):
        stored = sensor is BUILT_IN.get(sensor.name)
        way_out = f"write the stored parameters: softcover export {sensor.name} --out FOLDER" if stored else ""
        require("skfem", useful=("matplotlib",) if pictures else (), otherwise=way_out)
    else:
        require("skfem", useful=("pyvista",) if pictures else ())


def _draw_response(derivation: Derivation) -> None:
    """Print the response of the texels to a load on one of them as coloured text."""
    from validation.cli.heat_map import draw_share_image

    console = make_console()
    console.print("Uniform load on one texel: share of it on each texel, %")
    console.print(draw_share_image(derivation.texel_response_uniform))


def _list_results(derivation: Derivation) -> Iterator[tuple[str, str]]:
    from fastmodel.signal.electronics import describe_calibration

    fit, cover = derivation.fit, derivation.sensor.cover
    gaussian, errors = fit.gaussian, derivation.error_estimate
    yield "cover", describe_cover(cover)
    yield "sigma x, y", f"{gaussian.sigma_x:.4f}, {gaussian.sigma_y:.4f} pitches ({fit.estimator})"
    yield "ksize x, y", f"{gaussian.ksize_x}, {gaussian.ksize_y} texels"
    yield "kernel's misfit", f"{100 * fit.residual:.2f} % of the load on wrong texels (residual)"
    yield "beyond the kernel", f"{100 * fit.outside_kernel:.2f} % of the load"
    base, texels = derivation.resolution, derivation.resolution_on_array
    if base is None or texels is None:
        yield "side edges", "free: the spread differs from place to place; sigma is that of the middle texel"
    else:
        yield "resolution", f"{_format_length(base)} at the base"
        yield "", f"{_format_length(texels)} with these texels, worst alignment"
        yield "sigma / thickness", f"{derivation.sensitivity['thickness'] * 1e-3:+.3f} pitches per mm"
        yield "sigma / Poisson ratio", f"{derivation.sensitivity['poisson_ratio'] * 0.01:+.4f} pitches per 0.01"
    only_ratio = ", only the ratio of the layers' moduli counts" if len(cover.layers) > 1 else ""
    yield "sigma / Young's modulus", f"none: it drops out{only_ratio}"
    if derivation.depth is not None:
        foundation, contact = derivation.depth.foundation, derivation.depth.contact
        modulus = f"{1e-9 * foundation.modulus:.3g} +- {1e-9 * foundation.uncertainty:.2g} N/mm3"
        yield "foundation modulus", f"{modulus} ({foundation.estimator})"
        softness = f"solref {contact.solref[0]:.3g} s, 1; impedance {contact.solimp[0]:.4f}"
        yield "MuJoCo's plate", f"{softness}: {1e3 * contact.depth:.3g} mm under {1e3 * contact.mass:.3g} g"
    validity = derivation.parameters.validity
    if validity is None:
        yield "range of fast model", "not stated"
    else:
        ball = f"ball of {1e3 * validity.ball_radius:.3g} mm radius, {validity.strain} strain"
        yield "range of fast model", f"misplaces at most 2 % up to {_format_limit(validity, 2)} ({ball})"
        yield "", f"and at most 5 % up to {_format_limit(validity, 5)}"
    yield "characteristic", describe_calibration(derivation.parameters.electronics)
    if (tip := derivation.tip) is not None:
        shares = f"{tip.lightest:.4f} under a point load, {tip.heaviest:.4f} under {tip.largest_load:.3g} N"
        yield "", f"the share is fitted up to {tip.largest_load:.3g} N ({shares})"
    yield "error estimate", describe_errors(errors)
    yield "time", f"{derivation.seconds:.2f} s"
    for index, line in enumerate(derivation.undetermined):
        yield "" if index else "not determined", line


def _list_estimates(fit: Fit) -> Iterator[tuple[str, ...]]:
    """Yield the name and the sigmas along x and y of every estimator; the estimator that is used comes first."""
    for name, pair in sorted(fit.estimates.items(), key=lambda item: item[0] != fit.estimator):
        label = f"{name} (used)" if name == fit.estimator else name
        yield label, *("none" if math.isnan(value) else f"{value:.4f}" for value in pair)


def _format_limit(validity: Validity, percent: int) -> str:
    """Format the load up to which the fast model misplaces at most 2 or 5 % of the force."""
    load = validity.load_2_percent if percent == 2 else validity.load_5_percent  # noqa: PLR2004 -- percent
    if load == 0:
        return "no load"
    return f"{load:.3g} N" + (", the largest load compared" if load == validity.largest_load else "")


def _format_length(value: float) -> str:
    return "none" if math.isnan(value) else f"{1e3 * value:.2f} mm"
