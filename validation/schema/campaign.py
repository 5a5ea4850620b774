"""Tables of a campaign file: cases, compared metrics, and requirements on the fast model."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any, Self

from pydantic import ConfigDict, Field, PrivateAttr, create_model, model_validator

from validation.metrics import Score
from validation.schema import Table, types

#: Names of the metrics that a campaign can compare.
METRICS = tuple(field.name for field in dataclasses.fields(Score))
#: Names of metrics that count texels or compare areas, so that limits on them are plain numbers.
_PLAIN = ("pixels_changed", "pixels_changed_line", "pixels_lit_line", "active_area_iou")
#: Names of metrics that are no errors, so that an upper limit on them has no meaning.
_NOT_ERRORS = ("pixels_lit_line", "active_area_iou")
#: Largest accepted number of loads of one case in a campaign file [-].
_MOST_LOADS = 100
#: Largest accepted number of cases in a campaign file [-].
_MOST_CASES = 1000
#: Largest accepted number of further bodies of a case [-].
_MOST_OTHERS = 8
#: Largest accepted number of moving cases, and of instants of one of them [-].
_MOST_MOVING, MOST_INSTANTS = 50, 20_001
#: Longest history of a moving case, with its repetitions [s], and its largest load [N].
LONGEST_HISTORY, _LARGEST_LOAD = 20.0, 1e6
#: Keys for the load of a case in a campaign file, of which exactly one must be given.
_LOADS = ("load", "loads", "path")

#: Requirement on recordings: largest accepted image changed by the fast model, minus that of the best null model.
BEHIND_NULL = "behind_null_percent"
_Distance = Annotated[float, types.quantity("length", positive=False, most=types.LIMITS.longest)]
_Share = Annotated[float, types.percentage()]


def _find_kind(metric: str) -> Any:  # noqa: ANN401 -- an annotation
    """Return the annotation of a limit on a metric: a number, a length or a percentage, by the name of the metric."""
    if metric in _PLAIN:
        return Annotated[float, types.number(0, types.LIMITS.number)]
    return _Distance if metric.endswith("_m") else _Share


class _LimitsBase(Table):
    """Largest accepted values by metric."""

    _order: tuple[str, ...] = PrivateAttr(())

    @model_validator(mode="wrap")
    @classmethod
    def _keep_order(cls, data: Any, handler: Callable[[Any], Self]) -> Self:  # noqa: ANN401 -- content of a file
        """Keep the order in which the file states the limits, because reports list them in this order."""
        made = handler(data)
        made._order = tuple(data) if isinstance(data, Mapping) else ()  # noqa: SLF001 -- of this class
        return made

    def list_limits(self) -> dict[str, float]:
        """Return the stated limits in the units of the metrics: fractions, metres, or percent for `..._percent`."""
        return {
            name: 100 * value if name.endswith("_percent") else value
            for name in self._order
            if (value := getattr(self, name)) is not None
        }


if TYPE_CHECKING:
    LimitsTable = _LimitsBase
else:
    _FIELDS = {name: (_find_kind(name) | None, None) for name in METRICS if name not in _NOT_ERRORS}
    LimitsTable = create_model("LimitsTable", __base__=_LimitsBase, __doc__=_LimitsBase.__doc__, **_FIELDS)


class RecordingLimitsTable(_LimitsBase):
    """Largest accepted means over the scored loads of each split of the recordings, including their intervals.

    Attributes:
        image_changed_percent: Mean absolute difference of grey levels, over 255.
        behind_null_percent: The same difference minus that of the best null model.
        relative_l2: Norm of the difference of the counts over that of the recorded counts.
        total_counts_error: Absolute difference of the sums of counts over the recorded sum.
        centre_of_pressure_m: Distance between the centres of predicted and recorded counts.
        wasserstein_m: Wasserstein-1 distance of the two maps of counts.
    """

    image_changed_percent: _Share | None = None
    behind_null_percent: _Share | None = None
    relative_l2: _Share | None = None
    total_counts_error: _Share | None = None
    centre_of_pressure_m: _Distance | None = None
    wasserstein_m: _Distance | None = None


class RequiredTable(Table):
    """Requirements on the fast model.

    Attributes:
        mean: Largest accepted mean of each metric over the cases, including its interval.
        each: Largest accepted value of each metric in every single case.
        recordings: Largest accepted means over the scored loads of recordings.
    """

    mean: LimitsTable = LimitsTable()
    each: LimitsTable = LimitsTable()
    recordings: RecordingLimitsTable = RecordingLimitsTable()

    def list_faults(self) -> Iterator[tuple[str, str]]:
        """Yield a fault if no limit is stated."""
        if not self.mean.model_fields_set and not self.each.model_fields_set:
            yield "", "states no limit; write for example mean = { misplaced_force = '3 %' }"


class InputsTable(Table):
    """Standard uncertainties of the inputs of a comparison.

    Attributes:
        modulus: Relative uncertainty of Young's modulus, for materials that state no spread.
        poisson_ratio: Uncertainty of Poisson's ratio, for materials that state no spread.
        thickness: Relative uncertainty of the thickness of each layer.
        position: Uncertainty of the position of the indenter's axis, along x and along y.
        yaw: Uncertainty of the rotation of the indenter about its axis.
        friction: Upper bound of the friction coefficient, or "no-slip"; the lower bound is zero.
        data: Relative uncertainty of measured forces; 0 if finite elements replace a measurement.
    """

    modulus: Annotated[float, types.percentage(1)] | None = None
    poisson_ratio: Annotated[float, types.number(0, 1)] | None = None
    thickness: Annotated[float, types.percentage(1)] | None = None
    position: Annotated[float, types.quantity("length", positive=False, most=1)] | None = None
    yaw: Annotated[float, types.quantity("angle", positive=False, most=1)] | None = None
    friction: types.Friction | None = None
    data: Annotated[float, types.percentage(1)] | None = None


class LoadsForTable(Table):
    """Cover for which the loads are written; for another curved cover the loads are scaled by stiffness.

    Attributes:
        modulus: Young's modulus.
        thickness: Thickness.
    """

    modulus: types.Pressure = Field(examples=["1 MPa"])
    thickness: types.Length = Field(examples=["2 mm"])


class OtherTable(Table):
    """A further body that presses at the same time as that of a case.

    Attributes:
        indenter: Rigid body that presses on the cover.
        load: Load on the body.
        at: A named place, or the coordinates of the body's axis.
        yaw: Rotation of the body about its axis.
    """

    indenter: types.Indenter = Field(examples=["box:size=6mmx6mmx8mm"])
    load: types.Load = Field(examples=["100 g"])
    at: str = Field(examples=["0mm,9mm"])
    yaw: str | None = None


class CaseTable(Table):
    """One indentation that is scored; a list of loads or a loading path makes one case for each load.

    Attributes:
        name: Short name, unique in the campaign.
        indenter: Rigid body that presses on the cover.
        load: Load on the indenter.
        loads: Loads that are applied separately, each at once.
        path: Ascending loads of one loading path.
        at: A named place, or the coordinates of the indenter's axis.
        direction: On a curved cover, the direction of the motion: a name, or three numbers.
        yaw: Rotation of the indenter about its axis.
        tilt: Rotations about the x and y axes of the indenter's frame.
        compared: Metrics that are pooled over cases; all metrics when left out.
        required: Largest accepted values in this case, which replace those of the campaign.
        quick: Whether `--quick` and `--budget` take the case before others.
        others: Further bodies that press at the same time, on a wide cover of linear-elastic layers.
    """

    name: types.Name = Field(examples=["ball"])
    indenter: types.Indenter = Field(examples=["sphere:radius=5mm"])
    load: types.Load | None = None
    loads: Annotated[list[types.Load], Field(min_length=1, max_length=_MOST_LOADS)] | None = None
    path: Annotated[list[types.Load], Field(min_length=1, max_length=_MOST_LOADS)] | None = None
    at: str | None = None
    direction: str | None = None
    yaw: str | None = None
    tilt: str | None = None
    compared: Annotated[tuple[Annotated[str, types.choice(*METRICS)], ...], Field(min_length=1)] | None = None
    required: LimitsTable = LimitsTable()
    quick: Annotated[bool, Field(strict=True)] = False
    others: Annotated[tuple[OtherTable, ...], Field(max_length=_MOST_OTHERS)] = ()

    @property
    def all_loads(self) -> list[float]:
        """Loads of the case from the one key for loads that is given: load, loads or path [N]."""
        return [self.load] if self.load is not None else self.loads or self.path or []

    def list_faults(self) -> Iterator[tuple[str, str]]:
        """Yield faults of the loads, and limits on metrics that are not compared."""
        given = [key for key in _LOADS if getattr(self, key) is not None]
        if len(given) != 1:
            found = " and ".join(given) or "nothing"
            yield "load", f"give one of load, loads (each applied at once) and path (ascending), not {found}"
            return
        if self.others and (self.load is None or self.tilt is not None):
            yield "others", "several bodies have one load each and do not tilt; give load, without loads, path and tilt"
        loads = self.all_loads
        for k, load in enumerate(loads):
            if load in loads[:k]:
                yield f"{given[0]}[{k}]", f"{load:.4g} N is listed twice"
            elif self.path and k and load < loads[k - 1]:
                yield f"path[{k}]", "the loads of a path must ascend, because unloading is not computed"
        if self.compared is not None:
            for name in sorted(self.required.model_fields_set - set(self.compared)):
                yield f"required.{name}", "is not in `compared`; add it there, or remove the limit"


#: Standard gravity, for the time of a fall [m/s2].
_GRAVITY = 9.80665
_Instant = Annotated[float, types.quantity("time", positive=False, most=LONGEST_HISTORY)]
_LoadOrNone = Annotated[float, types.quantity("force", positive=False, most=_LARGEST_LOAD)]


class MovingTable(Table):
    """An indenter whose load or place changes in time, scored through the signal chain of each model.

    Load and place are linear between the instants.

    Attributes:
        name: Short name, unique among the moving cases.
        indenter: Rigid body that presses on the cover.
        history: CSV file beside the campaign file with time and load or place, instead of these keys.
        time: Ascending instants, the first one is zero.
        load: Load at each instant, or one load.
        fall: Height from which a body, whose weight is the load, falls on the cover in MuJoCo.
        at: Place at each instant, named or as coordinates of the indenter's axis, or one place.
        yaw: Rotation of the indenter about its axis.
        tilt: Rotations about the x and y axes of the indenter's frame.
        repeat: How often the history happens, one time after the other.
    """

    name: types.Name = Field(examples=["tap"])
    indenter: types.Indenter = Field(examples=["sphere:radius=5mm"])
    history: str | None = None
    time: Annotated[list[_Instant], Field(min_length=2, max_length=MOST_INSTANTS)] = Field(default=[])
    load: Annotated[list[_LoadOrNone], types.OneOrMore(), Field(min_length=1, max_length=MOST_INSTANTS)] = Field(
        default=[]
    )
    fall: Annotated[float, types.quantity("length")] | None = None
    at: Annotated[list[str], types.OneOrMore()] = Field(default=["centre"], min_length=1, max_length=MOST_INSTANTS)
    yaw: str | None = None
    tilt: str | None = None
    repeat: Annotated[int, types.number(1, 1000, whole=True)] = 1

    def list_faults(self) -> Iterator[tuple[str, str]]:
        """Yield faults of a fall, and missing keys."""
        if missing := [key for key in ("time", "load") if not getattr(self, key)]:
            yield missing[0], "is missing; give it here, or in a CSV file that `history` names"
            return
        if self.fall is not None:
            needed = (2 * self.fall / _GRAVITY) ** 0.5
            if len(self.time) > 2 or len(self.load) > 1 or len(self.at) > 1 or self.repeat > 1:  # noqa: PLR2004
                yield (
                    "fall",
                    "a body falls once, with one weight at one place: give two instants, one load and one place",
                )
            elif self.time[-1] <= needed:
                yield "time[1]", f"the fall lasts {needed:.3g} s; end the history later"


def _require_nothing(schema: dict[str, Any]) -> None:
    """Make no key required in a JSON Schema; values of the default campaign replace keys that are left out."""
    del schema["required"]


class CampaignTables(Table):
    """Cases in which the fast model is scored, its intended use, and the requirements on it.

    Attributes:
        name: Name of the campaign.
        intended_use: Intended use of the fast model.
        required: Acceptance criterion.
        inputs: Standard uncertainties of the inputs.
        loads_for: The cover for which the loads are written.
        deepest: Depth over thickness of a flat linear cover to which larger loads are lowered.
        case: Cases of the campaign.
        moving: Cases that change in time.
    """

    model_config = ConfigDict(json_schema_extra=_require_nothing)

    name: Annotated[str, Field(min_length=1)]
    intended_use: Annotated[str, Field(min_length=1)]
    required: RequiredTable
    inputs: InputsTable = InputsTable()
    loads_for: LoadsForTable | None = None
    deepest: Annotated[float, types.percentage(1)] | None = None
    case: Annotated[list[Any], types.OneByOne(CaseTable, most=_MOST_CASES)]
    moving: Annotated[list[Any], types.OneByOne(MovingTable, most=_MOST_MOVING)] = Field(default_factory=list)
