"""The command `softcover press`, which computes one indentation by finite elements and by the fast model."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from validation.cli import options, output
from validation.cli.entry import CHECK_FAILED, DONE, NOT_CONVERGED, OUTSIDE_FAILED
from validation.errors import InputError
from validation.render import escape

if TYPE_CHECKING:
    from fastmodel import Parameters
    from meshes.array_types import FloatArray
    from validation.campaign.comparison import Comparison
    from validation.press_files import LoadCurve
    from validation.press_history import HistoryPress
    from validation.pressing import PressRequest
    from validation.sensor_file import SensorDescription


#: Share of the force on wrong texels below which the fast model counts as good [-]. `softcover derive` states the range
#: of loads for this share.
GOOD_MISPLACED = 0.02
#: Share of the force on wrong texels below which the fast model counts as usable [-]. `softcover derive` states the
#: range of loads for this share.
USABLE_MISPLACED = 0.05
#: Error estimate of a press in time below which it is not printed [-].
_SMALL = 1e-6


def press(
    sensor: options.Sensor,
    *,
    indenter: options.Shape,
    load: options.Force | None = None,
    depth: options.Length | None = None,
    at: options.Place | None = None,
    direction: Annotated[options.Place | None, Parameter(metavar="DIRECTION")] = None,
    yaw: options.Angle | None = None,
    tilt: Annotated[options.Angle | None, Parameter(metavar="ANGLE,ANGLE")] = None,
    friction: Annotated[str | None, Parameter(metavar="COEFFICIENT", allow_leading_hyphen=True)] = None,
    strain: Annotated[str | None, Parameter(metavar="STRAIN")] = None,
    accuracy: Annotated[str | None, Parameter(metavar="PERCENT", allow_leading_hyphen=True)] = None,
    model: Annotated[str, Parameter(metavar="MODELS")] = "fem,fast",
    method: options.Method = "default",
    cover: options.CoverChanges = options.UNCHANGED,
    curve: int | None = None,
    in_time: options.InTime = options.AT_ONCE,
    out: options.Folder | None = None,
    json: options.Json = False,
) -> int:
    """Compute one indentation by finite elements and by the fast model, and compare the results.

    Only loading is computed: without friction, unloading retraces the same states; with friction it does not.

    Examples of use:

        softcover press wts-0614-34 --indenter sphere:radius=5mm --load 500g
        softcover press sensor.toml --indenter box:size=9mmx9mmx5mm --load 2N --at=1mm,-2mm --yaw=45deg
        softcover press wts-0614-34 --indenter cylinder:radius=4mm --depth 0.2mm --model fem --json
        softcover press sensor.toml --indenter roller:radius=30mm,length=40mm --load 5N --accuracy 0.5%
        softcover press derived --indenter sphere:radius=5mm --load 500g --model fast
        softcover press wts-0614-34 --indenter sphere:radius=5mm --depth 0.5mm --curve 20 --out curve
        softcover press rubber.toml --indenter sphere:radius=5mm --load 2N --hold 60s
        softcover press fingertip --indenter sphere:radius=4mm --load 1N --at=0mm,8mm,0mm --out pressed

    Args:
        load: Force in N, or a weight in g: 4.9N, 500g.
        depth: Approach of the indenter from first touch, instead of a load: 0.3mm.
        at: Position of the indenter's axis in the array's frame, e.g. 1mm,-2mm; on a curved cover x,y,z of a place
            on its surface. Or a name: centre, middle, off grid, edge, corner; on a curved cover also side. The middle
            of the array if left out.
        direction: Direction in which the indenter moves on a curved cover, e.g. 0,0,-1, or oblique x, oblique y; along
            the normal if left out.
        yaw: Rotation of the indenter about its axis, e.g. 30deg.
        tilt: Rotations about the x and y axes of the indenter, before the yaw, at most 10deg, on a curved cover 80deg:
            --tilt=2deg,0deg.
        friction: Friction between indenter and cover in the finite elements: Coulomb's coefficient, or no-slip; that of
            the sensor file if left out.
        strain: On curved covers: small (seconds), or finite (minutes; large depths, the material as it is). Flat covers
            follow their materials.
        accuracy: Wanted relative error of the finite elements, e.g. 1%; finer grids are added to reach it, and the exit
            status is 1 if they do not.
        model: Which models: fem, fast, or fem,fast.
        curve: Compute this many points of the curve of load over depth, by finite elements; needs --out.
        out: Folder for pictures, contact forces, displacement and stress in the cover, or for the curve or history.
    """
    from validation.extras import require
    from validation.pressing import read_request

    instead = "" if depth is not None else "use it as it is: --model fast"

    def find_sensor(needs_reference: bool) -> SensorDescription | Parameters:
        if needs_reference:
            relaxes = in_time != options.AT_ONCE
            return options.read_description(sensor, cover, any_cover=True, instead=instead, in_time=relaxes)
        return options.read_sensor(sensor, cover, any_cover=True)

    request = read_request(
        find_sensor, indenter, load=load, depth=depth, friction=friction, strain=strain, accuracy=accuracy,
        pose={"at": at, "direction": direction, "yaw": yaw, "tilt": tilt}, models=model, method=method, curve=curve,
        out=out, **vars(in_time),
    )  # fmt: skip
    if request.needs_reference:
        way_out = "" if out else request.way_out
        require("skfem", useful=("matplotlib", "pyvista") if out else (), otherwise=way_out)
    return _compute(request, curve, out, json=json)


def _compute(request: PressRequest, curve: int | None, out: Path | None, *, json: bool) -> int:
    """Compute one indentation, a curve or a history as requested, print it, and write its files to `out` if given."""
    from fem_reference.errors import PiercedError
    from validation.output_folder import optional_folder
    from validation.press_files import write_press
    from validation.scene.draw import lacks_picture

    found: Comparison | LoadCurve | HistoryPress
    try:
        with optional_folder(out) as folder, output.Progress() as progress:
            if request.history is not None:
                found = followed = request.follow(progress)
                show, write = partial(_print_history, followed), followed.write
            elif curve is not None:
                found = traced = request.trace(curve, progress)
                show, write = partial(_print_curve, traced), traced.write
            else:
                found = compared = request.run(fields=folder is not None, as_far=True, progress=progress)
                show, write = partial(_print_comparison, compared), partial(write_press, compared)
            files = write(folder) if folder else ()
    except PiercedError as error:
        raise InputError(f"--{error.control}: {error}") from error
    if json:
        output.print_json(found.as_json())
    else:
        show()
    for sentence in found.warnings:
        output.say(f"softcover: warning: {sentence}")
    if found.note:
        output.say(f"softcover: note: {found.note}")
    if files:
        output.say(f"wrote {', '.join(files)} to {out}")
    if found.stopped:
        output.say(f"softcover: {found.stopped}")
        return NOT_CONVERGED
    if not all(map(request.is_met_by, found.indentations)):
        return CHECK_FAILED
    return OUTSIDE_FAILED if lacks_picture(files) else DONE


def _print_curve(curve: LoadCurve) -> None:
    """Print a curve of load over depth."""
    columns = {
        "load_N": ("load [N]", 1), "depth_m": ("depth [mm]", 1e3), "contact_area_m2": ("area [mm²]", 1e6),
        "peak_texel_N": ("peak texel [N]", 1), "energy_J": ("energy [mJ]", 1e3),
    }  # fmt: skip
    _print_rows(columns, curve.rows())


def _print_history(found: HistoryPress) -> None:
    """Print a press in time."""
    columns = {
        "time_s": ("time [s]", 1), "load_N": ("load [N]", 1), "depth_m": ("depth [mm]", 1e3),
        "contact_depth_m": ("elastic depth", 1e3), "peak_texel_N": ("peak texel [N]", 1),
        "elastic_load_ratio": ("elastic load", 1), "elastic_misplaced": ("misplaced [%]", 100),
    }  # fmt: skip
    _print_rows(columns, found.pick_rows(), f"{found.case.shape} on {found.array.name} at {found.case.place}")
    estimates = {name: each for name, each in found.followed.error_estimate.items() if each > _SMALL}
    legend = (
        "Elastic depth [mm]: that of an elastic cover with this contact. Elastic load, misplaced: the load of an "
        "elastic cover over that of this one, and its force on wrong texels."
    )
    notes = (f"{note[0].upper()}{note[1:]}." for note in found.notes)
    errors = f"Error estimates over the largest force and depth: {output.describe_errors(estimates)}."
    output.print_meaning([legend, *notes, errors])


def _print_rows(columns: Mapping[str, tuple[str, float]], rows: Iterable[Mapping[str, float]], title: str = "") -> None:
    """Print a table of rows in SI units, given heading and factor of each column."""
    texts = [[f"{factor * row[name]:.4g}" for name, (_, factor) in columns.items()] for row in rows]
    output.print_table([heading for heading, _ in columns.values()], texts, title=title)


def _print_comparison(comparison: Comparison) -> None:
    """Print one press: images of the texel forces of the chosen models, their results and their scores."""
    from validation.cli.heat_map import draw_force_images
    from validation.press_picture import list_images
    from validation.sensor_file import SensorDescription

    console = output.make_console()
    case, sensor, array = comparison.case, comparison.sensor, comparison.sensor.array
    console.print(escape(f"{case.shape} on {array.name}, {case.load:.4g} N at {case.place}"), markup=False)
    if isinstance(sensor, SensorDescription):
        notes = "".join(f"; {sentence}" for sentence in sensor.cover.notes)
        console.print(escape(f"cover: {output.describe_cover(sensor.cover)}{notes}") + "\n", markup=False)
    images = list(list_images(comparison))
    console.print(draw_force_images(array, images, width=console.width))
    output.print_table((), _list_results(comparison))
    output.print_meaning(_explain_comparison(comparison))


def _list_results(comparison: Comparison) -> Iterator[tuple[str, str]]:
    """Yield the printed results of a press as pairs (name, text): each model, and the scores if both are computed."""
    from validation.metrics import TABULATED
    from validation.press_picture import describe_force

    fem, fast = comparison.fem, comparison.fast
    if fem is not None and "fem" in comparison.models:
        # The prescribed one of load and depth has no error.
        errors = output.describe_errors({name: value for name, value in fem.error_estimate.items() if value != 0})
        assumptions = ", ".join(f"{name}: {value}" for name, value in fem.assumptions.items())
        on_mesh = fem.mesh is not None
        yield "finite elements", describe_force(fem)
        yield "", f"depth {1e3 * fem.depth:.4f} mm, contact area {1e6 * fem.contact_area:.3f} mm²"
        if fem.energy is not None:
            yield "", f"elastic energy {1e3 * fem.energy:.4g} mJ"
        if on_mesh:
            for name, force in (("cover", fem.force), ("base", fem.base_force)):
                yield "", f"force on the {name} ({_format_vector(force)}) N"
            yield "", f"not measured ({_format_vector(fem.unmeasured)}) N: beside the texels and shear along them"
        yield "", f"error estimate {errors}"
        yield "", f"assumes {assumptions}; {fem.seconds:.2f} s"
        if fem.mesh is not None:
            kind = "hexahedra" if fem.mesh.is_hexahedral else "tetrahedra"
            yield "", f"finest mesh: {len(fem.mesh.cells)} {kind}, hash {fem.mesh.digest[:12]}"
    if fast is not None:
        yield "fast model", describe_force(fast)
        yield "", f"{fast.seconds:.3f} s"
    if comparison.score is not None:
        values = comparison.score.as_json()
        for index, (name, metric) in enumerate(TABULATED.items()):
            text = f"{metric.heading}: {metric.text(values[name])} {metric.unit}".rstrip()
            yield "" if index else "fast against finite", text


def _format_vector(values: FloatArray) -> str:
    return ", ".join(f"{round(float(each), 4) + 0.0:.4g}" for each in values)


def _explain_comparison(comparison: Comparison) -> Iterator[str]:
    """Yield sentences on the agreement of the two models, and on the accuracy of the finite elements."""
    from validation.campaign.results import texel_error
    from validation.press_picture import is_pulled, list_images

    score, fem, fast = comparison.score, comparison.fem, comparison.fast
    forces = [(name, each) for name, each in list_images(comparison) if name != "difference" and is_pulled(each)]
    if pulled := ", ".join(f"{1e3 * each.min():.3g} mN ({name})" for name, each in forces):
        yield f"Negative forces on texels, down to {pulled}: beside the touch the cover lifts and pulls at its base."
    if score is not None:
        share = score.misplaced_force
        yield (
            f"The fast model puts {100 * share:.1f} % of the force on wrong texels here (good: below "
            f"{100 * GOOD_MISPLACED:.0f} %, usable: below {100 * USABLE_MISPLACED:.0f} %)."
        )
        if fem is not None and share < (own := texel_error(fem.error_estimate)):
            yield f"That is below the finite elements' own error of {100 * own:.2g} %, so it shows no difference."
        if share > GOOD_MISPLACED:
            method = "" if fast is None or fast.method == "cover" else "; `--method cover` is the most accurate method"
            yield (
                "It is one linear response: a deep or sharp touch on a soft cover leaves its range. Press less, or "
                f"take the finite elements{method}. `softcover derive` states the range."
            )
    elif fast is not None:
        yield "No finite elements were computed: `--model fem,fast` shows how far the fast model is right here."
    if fem is not None and "fem" in comparison.models:
        remedy = "`--accuracy 1%` adds finer grids" if fem.mesh is None else "take it as their uncertainty"
        yield output.explain_error(fem.error_estimate, remedy)
        if fem.mesh is not None:
            yield (
                "The force on a texel is the resultant on it along its own normal, so forces on a curved base do not "
                "sum to the load; the balance is that of the forces on cover and base."
            )
