"""Tables of a sensor file: array, cover, contact, filter, spread and electronics of a tactile sensor."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, ConfigDict, Discriminator, Field, Tag, model_validator

from fastmodel.signal.creep import MOST_CREEP
from fastmodel.signal.electronics import TEXEL_FORCE
from meshes import Cover
from meshes.layer import ONE_LAYER, Layers
from meshes.surfaces.files import SURFACES, TETRAHEDRA
from meshes.surfaces.smooth import CREASE
from validation.errors import InputError, shorten
from validation.schema import Table, types
from validation.text.quantity import read_quantity

#: Largest radius of a calibration tip [m].  A wider tip presses on several texels of any array.
_WIDEST_TIP = 0.02
#: Pattern of the key `calibrated` of a sensor file for a characteristic that was measured with a tip on the cover.  The
#: text ends with the radius of the tip, a number and a unit.
_THROUGH_COVER = re.compile(r"through the cover, tip (\S{1,20} ?[a-zA-Z\u00b5\u03bc]{1,20})")
#: Number of coefficients of the electronics' characteristic, a polynomial of degree 5 [-].
_COEFFICIENTS = 6


def _read_mask(value: object) -> list[list[str]]:
    """Return the entries of a mask, given as texts of 0 and 1 or as lists of them, one for each row."""
    lines: list[Any] = value if isinstance(value, list) else [None]
    if not all(isinstance(line, str | list) for line in lines):
        raise ValueError("must be a list of texts of 0 and 1, one for each row of texels, row 0 (smallest y) first")
    return [[str(entry)[:2] for entry in line] for line in lines]


def _refuse_free_edges(value: object) -> None:
    raise ValueError(
        f"a cover with a size has free side edges, one without is wide; remove the key, not {shorten(value)}"
    )


def _refuse_even(value: int) -> int:
    if value % 2 == 0:
        raise ValueError(f"must be odd, not {value}")
    return value


def _refuse_other_degrees(coefficients: list[float]) -> list[float]:
    if len(coefficients) != _COEFFICIENTS:
        raise ValueError(f"takes {_COEFFICIENTS} numbers c0..c5 [1/N^k]")
    return coefficients


def _read_calibration(value: object) -> str:
    """Read to which force the characteristic relates the counts, and return it in the form of `Electronics.calibrated`.

    It is the force on a texel, or the force of a tip on the cover.
    """
    if value == TEXEL_FORCE:
        return TEXEL_FORCE
    accepted = f"accepted: '{TEXEL_FORCE}' or 'through the cover, tip 1 mm' (radius of the tip's hemispherical end)"
    tip = _THROUGH_COVER.fullmatch(value) if isinstance(value, str) else None
    if tip is None:
        raise ValueError(f"{shorten(value)} is not what a characteristic can be calibrated against; {accepted}")
    try:
        radius = read_quantity(tip[1], "length")
    except InputError as error:
        raise ValueError(f"{'; '.join(error.faults)}; {accepted}") from None
    if not 0 < radius <= _WIDEST_TIP:
        raise ValueError(f"the radius of the tip must lie in 0..{1e3 * _WIDEST_TIP:g} mm, not {tip[1]!r}; {accepted}")
    return f"through the cover, tip {1e3 * radius:.9g} mm"


#: Axis 0..2, sign and value of a half-space: sign times the coordinate is less than sign times the value [m].
HalfSpace = tuple[int, float, float]


def _read_half_space(value: object) -> HalfSpace:
    """Read a half-space such as "z < 1 mm".

    Raises:
        ValueError: If the text is none.
    """
    found = re.fullmatch(r"\s*([xyz])\s*([<>])\s*(.+)", value) if isinstance(value, str) else None
    if found is None:
        raise ValueError(f'{shorten(value)} is no half-space; write for example "z < 1 mm"')
    sign = 1.0 if found[2] == "<" else -1.0
    try:
        return "xyz".index(found[1]), sign, read_quantity(found[3], "length")
    except InputError as error:
        raise ValueError("; ".join(error.faults)) from None


def _read_range(value: object) -> tuple[float, bool]:
    """Read the end of a stated range; return it [N or Pa], and whether it is a pressure."""
    for kind in ("force", "pressure"):
        with suppress(InputError):
            return types.quantity(kind).read(value), kind == "pressure"
    raise ValueError(f"{shorten(value)} is no force on a texel and no pressure; write for example '250 kPa' or '5 N'")


_OddCount = Annotated[types.TexelCount, AfterValidator(_refuse_even)]
_Sigma = Annotated[float, types.number(1e-3, 100)]
_Counts = Annotated[float, types.number(0, 1e9)]
_MASK_JSON = {"type": "array", "items": {"anyOf": [{"type": "string"}, {"type": "array", "items": {"enum": [0, 1]}}]}}


def _allow_positions_in_json(schema: dict[str, Any]) -> None:
    """State in a JSON Schema that `positions` replaces the keys of a grid."""
    schema["anyOf"] = [{"required": schema.pop("required")}, {"required": ["positions"]}]


class ArrayTable(Table):
    """Texels on a grid of given rows, columns and pitch, or at positions that another file lists.

    Attributes:
        rows: Number of rows, along y.
        columns: Number of columns, along x.
        pitch: Distance between the centres of texels, or [x, y].
        positions: CSV file with the centres of the texels, instead of a grid.
        unit: Unit of the file of positions; metres when left out.
        project: Whether texels are moved to the base of a curved cover.
        texel_size: Sensitive rectangle of a texel, or [x, y]; the pitch when left out.
        margin: Width of a flat cover beyond the texels, from half a pitch beyond the outermost centres, or [x, y].
        mask: One text of 0 and 1 for each row, smallest y first; 0 marks a missing texel.
        name: Name of the array.
    """

    model_config = ConfigDict(json_schema_extra=_allow_positions_in_json)

    rows: types.TexelCount | None = Field(examples=[14])
    columns: types.TexelCount | None = Field(examples=[6])
    pitch: types.Lengths | None = Field(examples=["3.4 mm"])
    positions: str | None = None
    unit: types.LengthUnit | None = None
    project: Annotated[bool, Field(strict=True)] = False
    texel_size: types.Lengths | None = None
    margin: types.Widths | None = None
    mask: Annotated[list[list[str]], types.Read(_read_mask, _MASK_JSON)] | None = None
    name: str | None = None

    def list_faults(self) -> Iterator[tuple[str, str]]:
        """Yield a fault if only one of rows and columns is given with positions."""
        if (self.rows is None) != (self.columns is None):
            yield "", "give both rows and columns, or leave both out: the image is then one row of texels"

    @model_validator(mode="before")
    @classmethod
    def _allow_positions_alone(cls, data: object) -> object:
        """Set missing keys of a grid to None if the table has the key `positions`, which replaces the grid."""
        if isinstance(data, Mapping) and "positions" in data:
            return dict.fromkeys(("rows", "columns", "pitch")) | dict(data)
        return data


class FlatCoverTable(Table):
    """A cover of flat layers.

    Attributes:
        layer: Layers from bottom to top.
        base: Support of the bottom: glued ("bonded", when left out), or sliding without friction.
        size: Size along x and y, centred on the array, with free side edges; infinitely wide when left out.
        assumed: Whether thickness and material were never measured, which reports state.
        free_edges: Refused, with an explanation.
    """

    layer: Annotated[list[types.LayerTable], Field(min_length=1)]
    base: Annotated[Literal["bonded", "sliding"], types.choice("bonded", "sliding")] = "bonded"
    size: types.Lengths | None = None
    assumed: Annotated[bool, Field(strict=True)] = False
    free_edges: Annotated[None, types.Read(_refuse_free_edges, {"not": {}})] = None

    def make(self) -> Cover:
        """Make the cover that the table describes."""
        layers = tuple(each.make() for each in self.layer)
        return Cover(layers=layers, base=self.base, size=self.size, assumed=self.assumed)


#: A cover of flat layers.
FlatCover = Annotated[Cover, types.TableOr(FlatCoverTable, lambda value, read_table: read_table(value).make())]


class CurvedCoverTable(Table):
    """A cover whose shape is in files: of one material, or of layers in a swept mesh.

    Attributes:
        material: Name of a material of the catalogue, or a table of a material model and its parameters.
        layer: Layers from base to top of a mesh of hexahedra, instead of a material.
        surface: File of the outer surface.
        base: File of the surface to which the cover is bonded.
        mesh: File of tetrahedra, instead of surfaces.
        thickness: Thickness below the outer surface, or above the base.
        unit: Unit of the files.
        element_size: Size of the elements of the finer mesh.
        base_distance: Distance up to which a surface counts as bonded.
        left_out: Half-spaces such as "z < 1 mm"; faces in them are not touched, and have no cover below them.
        crease_angle: Angle in degrees from which an edge of a surface stays sharp; 0 keeps all facets.
    """

    material: types.AnyMaterial | None = None
    layer: list[types.LayerTable] | None = None
    surface: str | None = None
    base: str | None = None
    mesh: str | None = None
    thickness: types.Length | None = None
    unit: types.LengthUnit | None = None
    element_size: types.Length | None = None
    base_distance: types.Length | None = None
    left_out: list[Annotated[HalfSpace, types.Read(_read_half_space)]] | None = None
    crease_angle: Annotated[float, types.number(0, 180)] = CREASE

    @property
    def layers(self) -> Layers:
        """The material of the cover, or its layers."""
        return self.material or tuple(each.make() for each in self.layer or ())

    def list_faults(self) -> Iterator[tuple[str, str]]:
        """Yield faults of missing keys and of keys that exclude each other."""
        own = self.mesh is not None and self.mesh.lower().endswith(".npz")
        yield from self._list_layer_faults(swept=own)
        if self.mesh is not None:
            replaced = ("surface", "thickness", "element_size", *(("left_out",) if own else ()))
            if given := [name for name in replaced if getattr(self, name) is not None]:
                yield "mesh", f"replaces {' and '.join(given)}; leave out what it replaces"
            if not own and self.base is None:
                yield "base", 'is missing; write for example base = "core.stl", the surface to which the mesh is bonded'
        elif self.surface is None and self.base is None:
            yield "surface", 'is missing; write for example surface = "outer.stl" with thickness or base'
        elif (self.thickness is None) == (self.surface is None or self.base is None):
            yield "thickness", 'give surface and base, or one of them and thickness = "2 mm"'
        if self.unit is None and not own:
            yield "unit", 'is missing, and the files do not state it; write for example unit = "mm"'
        for name in ("surface", "base", "mesh"):
            kinds = (".npz", *TETRAHEDRA) if name == "mesh" else SURFACES
            value = getattr(self, name)
            if value is not None and not value.lower().endswith(kinds):
                yield name, f"{shorten(value)} has an unknown ending; accepted: {', '.join(kinds)}"

    def _list_layer_faults(self, *, swept: bool) -> Iterator[tuple[str, str]]:
        """Yield faults of a missing material, and of layers beside a material or without a mesh that may be swept."""
        if self.layer is not None and (self.material is not None or not swept):
            yield "layer", f'replaces material, and needs mesh = "mesh.npz": {ONE_LAYER}'
        elif not (self.material or self.layer):
            yield "material", 'is missing; write for example material = "dragon-skin-30"'


class ContactTable(Table):
    """Contact between indenter and cover.

    Attributes:
        friction: Coulomb's coefficient in the finite elements, or "no-slip"; the fast model has no friction.
    """

    friction: types.Friction = 0.0


class FilterTable(Table):
    """Butterworth low-pass filter before the electronics.

    Attributes:
        cutoff: Cutoff frequency.
        order: Order.
    """

    cutoff: types.Frequency = Field(examples=["40 Hz"])
    order: Annotated[int, types.number(1, 20, whole=True)] = 2


class SpreadTable(Table):
    """A Gaussian kernel that replaces the kernel that `softcover derive` fits.

    Attributes:
        sigma_x: Standard deviation along x, in texel pitches.
        sigma_y: Standard deviation along y, in texel pitches.
        ksize_x: Size of the kernel along x, an odd number of texels.
        ksize_y: Size of the kernel along y, an odd number of texels.
    """

    sigma_x: _Sigma = Field(examples=[0.5])
    sigma_y: _Sigma = Field(examples=[0.5])
    ksize_x: _OddCount = Field(examples=[5])
    ksize_y: _OddCount = Field(examples=[5])


class ElectronicsTable(Table):
    """Conversion of texel forces to counts; missing values are assumed and labelled as assumed.

    Attributes:
        rate: Frames per second.
        sensitivity: Slope of the characteristic, counts = sensitivity * force + offset.
        range: Largest force on a texel, or largest pressure; without sensitivity and characteristic the counts rise in
            a straight line up to it.
        offset: Counts without a touch.
        output_max: Counts at saturation; 2^bits - 1 when left out.
        bits: Bits of the converter.
        noise: Standard deviation of the noise on each texel force.
        threshold: Counts that the firmware subtracts; negative results become 0.
        saturation_band: Counts below output_max over which the curve bends into saturation.
        characteristic: Coefficients c0..c5 of counts = sum of c_k force^k, instead of sensitivity.
        gains: One factor for each texel.
        creep: Growth of the reading in a factor e of the time under a constant load, 0 to 0.2.
        high_pass: Cut-off of a first-order high-pass, as of piezoelectric arrays, which see changes only.
        calibrated: Force of the characteristic: "texel force", or "through the cover, tip 1 mm".
    """

    rate: types.Frequency | None = None
    sensitivity: Annotated[float, types.quantity("per force")] | None = None
    range: Annotated[tuple[float, bool], types.Read(_read_range)] | None = None
    offset: types.Number = 0.0
    output_max: types.Count | None = None
    bits: Annotated[int, types.number(1, 32, whole=True)] = 12
    noise: Annotated[float, types.quantity("force", positive=False)] = 0.0
    threshold: _Counts = 0.0
    saturation_band: _Counts = 0.0
    characteristic: Annotated[list[types.Number], AfterValidator(_refuse_other_degrees)] | None = None
    gains: list[types.Number] | None = None
    creep: Annotated[float, types.number(0, MOST_CREEP)] = 0.0
    high_pass: types.Frequency | None = None
    calibrated: Annotated[str, types.Read(_read_calibration)] = TEXEL_FORCE

    def list_faults(self) -> Iterator[tuple[str, str]]:
        """Yield faults of two characteristics, of a range beside one, and of an output too large for the converter."""
        largest = 2**self.bits - 1
        if self.sensitivity is not None and self.characteristic is not None:
            yield "", "give either sensitivity (a line, '2665.7 1/N') or characteristic (c0..c5 [1/N^k]), not both"
        if self.range is not None and (self.sensitivity is not None or self.characteristic is not None):
            yield "range", "stands in place of sensitivity and characteristic, which tell the range; remove one of them"
        if self.output_max is not None and self.output_max > largest:
            yield "output_max", f"{self.output_max} does not fit {self.bits} bits; accepted: 1..{largest}"


def _find_kind_of_cover(value: Any) -> str:  # noqa: ANN401 -- a table or its content
    """Return the tag of the table of a cover: that of a curved one if its shape is in files."""
    if isinstance(value, Mapping) and (
        any(name in value for name in ("surface", "mesh", "unit")) or "." in str(value.get("base", ""))
    ):
        return "[CurvedCoverTable]"
    return "[FlatCoverTable]"


class SourcesTable(Table):
    """Where the numbers of a published sensor are stated: title, year, DOI or address.  What is left out is not stated.

    Attributes:
        texels: Source of rows, columns and mask.
        pitch: Source of the pitch.
        rate: Source of the frame rate.
        range: Source of the range, or of the characteristic.
        bits: Source of the bits.
        cover: Source of the layers.
    """

    texels: str | None = None
    pitch: str | None = None
    rate: str | None = None
    range: str | None = None
    bits: str | None = None
    cover: str | None = None


class SensorTables(Table):
    """A tactile sensor: its array, its cover and its electronics.

    Attributes:
        array: Texels of the sensor.
        cover: Elastic cover over the texels: flat layers, or a shape in files.
        electronics: Conversion of texel forces to counts.
        contact: Contact between indenter and cover.
        filter: Low-pass filter before the electronics.
        spread: Kernel that replaces the fitted one.
        sources: Where the numbers are stated, for a sensor that others published.
        name: Name of the sensor in tables and reports; the name of the file when left out.
    """

    array: ArrayTable
    cover: Annotated[
        Annotated[FlatCoverTable, Tag("[FlatCoverTable]")] | Annotated[CurvedCoverTable, Tag("[CurvedCoverTable]")],
        Discriminator(_find_kind_of_cover),
    ]
    electronics: ElectronicsTable = ElectronicsTable()
    contact: ContactTable = ContactTable()
    filter: FilterTable | None = None
    spread: SpreadTable | None = None
    sources: SourcesTable | None = None
    name: str | None = None
