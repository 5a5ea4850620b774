"""The description of a tactile sensor, read from a sensor file (TOML) or taken from the built-in sensors."""

from __future__ import annotations

import dataclasses
import importlib
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from fastmodel.signal.butterworth import Butterworth
from fastmodel.signal.electronics import WTS_0614_34, Electronics
from fastmodel.signal.point_spread import Gaussian
from meshes import Cover, SolidCover, TexelArray
from meshes.array import MOST_TEXELS, check_texel_count
from meshes.array_types import FloatArray
from meshes.bounded_file import FileLimitError, read_text
from meshes.catalogue import ARRAYS, ASSUMED_COVER
from meshes.solids import fingertip, flat_pad, phalanx
from meshes.solids.covers import make_swept_cover
from validation.errors import InputError, at, nearest
from validation.schema import parse as parse_tables
from validation.schema import read, read_raw
from validation.schema.sensor import ArrayTable, CurvedCoverTable, SensorTables

#: Largest accepted size of a file of texel positions [bytes]: 200 for each texel.
_MOST_BYTES = 200 * MOST_TEXELS
#: Columns of a file of texel positions: centres of the texels [m], and their unit normals [-] if the array is curved.
_COLUMNS = ("x", "y", "z", "nx", "ny", "nz")
#: Largest accepted coordinate of a texel; larger ones must have a wrong unit [m].
_FARTHEST = 1000.0
#: Largest difference between the heights of texels that count as one plane [m].
_SAME_HEIGHT = 1e-9
_EXAMPLE = "the first line must read x,y,z or x,y,z,nx,ny,nz, then one line of numbers in metres per texel"
#: Frame rate of a sensor whose file does not state it [Hz].
_ASSUMED_RATE = 100.0
#: Slope of the characteristic of a sensor whose file does not state it [counts/N].  With 12 bits the counts then
#: saturate at 4.1 N on a texel.
_ASSUMED_SENSITIVITY = 1000.0
#: Electronics of the tactile arrays of the SCHUNK SDH-2 hand.  Their characteristic (counts over force) is unpublished,
#: so the slope of the WTS 0614-34 is used.  The offset of the WTS 0614-34 is left out, because the firmware of the
#: DSACON32m, which reads the arrays, subtracts a threshold.  To score recordings, a fitted characteristic replaces this
#: one.
_SDH2_ELECTRONICS = Electronics(
    rate_hz=31.25,
    sensitivity=WTS_0614_34.sensitivity,
    output_max=3512,
    bits=12,
    calibrated=WTS_0614_34.calibrated,
)
#: Sources of the numbers of the sensors in `BUILT_IN`.
_REPORT = "2015 internship report on the WTS 0614-34"
_RECORDINGS = "headers and time stamps of the recordings in github.com/peter-kiechle/tactile-sensors (2015)"
#: Files of the published sensors, and their names.
_PUBLISHED = Path(str(resources.files("validation.sensor_file").joinpath("sensors")))
PUBLISHED = tuple(sorted(path.stem for path in _PUBLISHED.glob("*.toml")))


@dataclasses.dataclass(frozen=True, kw_only=True)
class SensorDescription:
    """A tactile sensor: array, cover and electronics, in SI units.

    Attributes:
        name: Name of the sensor in tables and reports.
        array: Texels of the sensor.
        cover: Elastic layers over the texels; `cover.assumed` is true if the real cover was never measured.
        electronics: Conversion from texel forces to counts.
        filter: Low-pass filter before the electronics, or None.
        spread: Gaussian spread kernel that replaces the fitted kernel, or None.
        friction: Coulomb friction coefficient between indenter and cover in the finite elements, inf for no slip.  A
            derivation and the fast model have no friction [-].
        source: Path of the sensor file, or the name of the built-in sensor.
        sources: Where each number is stated, by quantity: texels, pitch, rate, range, bits, cover; one without an entry
            is not stated.
        assumed_electronics: Assumed values of properties of the electronics that the sensor file does not state, one
            text each; counts depend on them, forces do not.
    """

    name: str
    array: TexelArray
    cover: Cover | SolidCover
    electronics: Electronics
    filter: Butterworth | None = None
    spread: Gaussian | None = None
    friction: float = 0.0
    source: str = ""
    sources: Mapping[str, str] = dataclasses.field(default_factory=dict)
    assumed_electronics: tuple[str, ...] = ()

    @property
    def layered_cover(self) -> Cover:
        """The cover, for computations that support planar layers only.

        Raises:
            InputError: If the cover is a solid.
        """
        return self.require_layers(
            f"{self.source}: has a curved cover, which this command cannot treat; `softcover mesh`, `derive`, "
            "`press` and `validate` can; `export --format mjcf`, `view`, `datasheet` and `emulate` take the folder "
            "that `derive --out` writes"
        )

    def require_layers(self, fault: str) -> Cover:
        """Return the cover if it consists of planar layers.

        Args:
            fault: Message of the error.

        Raises:
            InputError: If the cover is a solid.
        """
        if not isinstance(self.cover, Cover):
            raise InputError(fault)
        return self.cover

    def locate(self, frames: npt.ArrayLike | str | Path, **options: Any) -> Any:  # noqa: ANN401 -- as `validation.locate`
        """Find touches in frames of this sensor: `validation.locate`, with its options and its result."""
        return importlib.import_module("validation.resolution.verb").locate(self, frames, **options)

    def describe_cover(self) -> dict[str, Any]:
        """Return the cover as a dictionary of JSON values, with the key `assumed`."""
        cover, names = self.cover, ("model", "youngs_modulus", "poisson_ratio", "source", "spread")
        return {
            "assumed": cover.assumed,
            "base": cover.base,
            "size_m": cover.size,
            "thickness_m": cover.thickness,
            **({"body": cover.source} if cover.source else {}),
            "layers": [
                {
                    "thickness_m": layer.thickness,
                    "material": layer.material.name,
                    **{name: getattr(layer.material, name) for name in names},
                }
                for layer in cover.layers
            ],
        }


#: Sensors with planar layers that a user can name instead of a sensor file, by name.  Their covers are assumed, not
#: measured.
BUILT_IN: Mapping[str, SensorDescription] = MappingProxyType(
    {
        name: SensorDescription(
            name=name,
            array=ARRAYS[name],
            cover=ASSUMED_COVER,
            electronics=electronics,
            source=f"built-in {name}",
            sources=dict.fromkeys(stated, source),
        )
        for name, electronics, stated, source in (
            ("wts-0614-34", WTS_0614_34, ("texels", "pitch", "rate", "range", "bits"), _REPORT),
            ("sdh2-distal", _SDH2_ELECTRONICS, ("texels", "pitch", "rate", "bits"), _RECORDINGS),
        )
    }
)

#: Sensors with solid covers that a user can name instead of a sensor file, by name: curved covers, and a flat pad with
#: free sides.
CURVED: Mapping[str, SensorDescription] = MappingProxyType(
    {
        name: SensorDescription(
            name=name,
            array=made.texels,
            cover=make_swept_cover(made, ASSUMED_COVER.layers[0].material, words, assumed=ASSUMED_COVER.assumed),
            electronics=Electronics(rate_hz=_ASSUMED_RATE, sensitivity=_ASSUMED_SENSITIVITY, output_max=4095, bits=12),
            source=f"built-in {name}",
            assumed_electronics=(f"{_ASSUMED_RATE:g} frames/s", f"{_ASSUMED_SENSITIVITY:g} counts per N on a texel"),
        )
        for name, made, words in (
            ("flat-pad", flat_pad(), "pad of 20 x 20 mm with free sides"),
            ("phalanx", phalanx(), "120 degrees of a cylinder of 6 mm radius, 20 mm long"),
            (
                "fingertip",
                fingertip(),
                "half a cylinder of 6 mm radius, 14.4 mm long, with a quarter sphere at its end",
            ),
        )
    }
)


def load(
    sensor: str | Path, *, material: str | None = None, thickness: str | None = None, layers: Sequence[str] = ()
) -> SensorDescription:
    """Read the description of a sensor from a sensor file, or take that of a built-in sensor.

    Args:
        sensor: Path of a sensor file, or a name in `BUILT_IN`, `PUBLISHED` or `CURVED`.
        material: Name of a material in the catalogue that replaces the cover's material.
        thickness: Thickness with its unit that replaces the cover's thickness.
        layers: Changes of single layers, such as `2:thickness=1mm,youngs_modulus=3GPa`; layer 1 is the bottom one.

    Raises:
        InputError: With one line per fault: the place in the file, what is wrong, and what would be accepted.
        OSError: If the file exists and cannot be read.
    """
    description = BUILT_IN.get(str(sensor)) or CURVED.get(str(sensor))
    if description is None and str(sensor) in PUBLISHED:
        path = _PUBLISHED / f"{sensor}.toml"
        description = dataclasses.replace(_build(read(path, SensorTables), path), source=f"built-in {sensor}")
    if description is None:
        names = nearest(str(sensor), (*BUILT_IN, *PUBLISHED, *CURVED))
        hint = f"or built-in sensor; {names}, or a file from `softcover init`"
        description = _build(read(Path(sensor), SensorTables, hint=hint), Path(sensor))
    if material is None and thickness is None and not layers:
        return description
    from validation.sensor_file.changed_cover import change_cover

    cover = change_cover(description.cover, material=material, thickness=thickness, layers=layers)
    return dataclasses.replace(description, cover=cover)


def read_tables(sensor: str | Path) -> dict[str, Any]:
    """Read the tables of a sensor file without a check, or make those of a built-in sensor with planar layers.

    Args:
        sensor: Path of a sensor file, or a name in `BUILT_IN` or `PUBLISHED`.

    Raises:
        InputError: If there is no such file or sensor.
        OSError: If the file exists and cannot be read.
    """
    if (found := BUILT_IN.get(str(sensor))) is None:
        path = _PUBLISHED / f"{sensor}.toml" if str(sensor) in PUBLISHED else Path(sensor)
        return read_raw(path, SensorTables, hint=f"or built-in sensor; {nearest(str(sensor), (*BUILT_IN, *PUBLISHED))}")
    array, electronics, cover = found.array, found.electronics, found.layered_cover
    stuff, keys = cover.layers[0].material, ("name", "model", "poisson_ratio", "source", "spread")
    material = {name: getattr(stuff, name) for name in keys}
    material["youngs_modulus"] = f"{stuff.parameters['youngs_modulus']!r} Pa"
    same = ("sensitivity", "offset", "output_max", "bits", "calibrated")
    return {
        "name": found.name,
        "array": {"rows": array.rows, "columns": array.columns, "pitch": [f"{each!r} m" for each in array.pitch]}
        | {"mask": ["".join(map(str, row)) for row in array.image(array.active).astype(int)]},
        "cover": {"assumed": True, "layer": [{"thickness": f"{cover.thickness!r} m", "material": material}]},
        "electronics": {name: getattr(electronics, name) for name in same}
        | {"rate": f"{electronics.rate_hz!r} Hz", "sensitivity": f"{electronics.sensitivity!r} 1/N"},
    }


def read_template() -> str:
    """Return the text of a sensor file of a home-made sensor, with all keys explained."""
    return resources.files("validation.sensor_file").joinpath("template.toml").read_text(encoding="utf-8")


def parse(data: Mapping[str, Any], *, source: Path) -> SensorDescription:
    """Convert the parsed tables of a sensor file to the description of the sensor.

    Args:
        data: The tables, as the TOML parser returns them.
        source: Path of the sensor file, for error messages; the path `array.positions` is relative to its folder.

    Raises:
        InputError: With one line per fault.
    """
    return _build(parse_tables(data, SensorTables, source=str(source)), source)


def _build(tables: SensorTables, source: Path) -> SensorDescription:
    """Make the description of a sensor from its tables."""
    table, name = tables.electronics, tables.name or source.stem
    with at(f"{source}: "):
        array = build_array(tables.array, name=name, folder=source.parent)
        array, cover = _build_cover(tables, array, source.parent)
        if table.gains is not None and len(table.gains) != array.count:
            raise InputError(f"electronics.gains: takes one number per texel ({array.count}), not {len(table.gains)}")
    values: dict[str, Any] = {key: tuple(value) if isinstance(value, list) else value for key, value in table}
    assumed = []
    if table.rate is None:
        assumed.append(f"{_ASSUMED_RATE:g} frames/s")
    rate = values.pop("rate") or _ASSUMED_RATE
    if table.high_pass is not None and table.high_pass >= rate / 2:
        raise InputError(
            f"{source}: electronics.high_pass: {table.high_pass:g} Hz must lie below half of {rate:g} frames/s; lower "
            "it, or state electronics.rate"
        )
    values["output_max"] = table.output_max or 2**table.bits - 1
    stated = values.pop("range")
    if table.sensitivity is None and table.characteristic is None and stated is not None:
        values["sensitivity"] = values["output_max"] / (stated[0] * (np.prod(array.texel_size) if stated[1] else 1.0))
        assumed.append("a straight line of counts up to the stated range")
    elif table.sensitivity is None:
        # With a polynomial characteristic the sensitivity has no effect, but `Electronics` requires a positive number.
        values["sensitivity"] = _ASSUMED_SENSITIVITY if table.characteristic is None else 1.0
        if table.characteristic is None:
            assumed.append(f"{_ASSUMED_SENSITIVITY:g} counts per N on a texel")
    low_pass = tables.filter
    return SensorDescription(
        name=name,
        array=array,
        cover=cover,
        electronics=Electronics(rate_hz=rate, high_pass_hz=values.pop("high_pass"), **values),
        filter=None if low_pass is None else Butterworth(cutoff_hz=low_pass.cutoff, order=low_pass.order),
        spread=None if tables.spread is None else Gaussian(**tables.spread.model_dump()),
        friction=tables.contact.friction,
        source=str(source),
        sources=_name_sources(tables, cover),
        assumed_electronics=tuple(assumed),
    )


def _name_sources(tables: SensorTables, cover: Cover | SolidCover) -> dict[str, str]:
    """Return the source of each quantity that a sensor file states: the table `[sources]`, or else the file itself."""
    if tables.sources is not None:
        return {name: source for name, source in tables.sources if source}
    table = tables.electronics
    stated = {
        "texels": True,
        "pitch": True,
        "rate": table.rate,
        "range": table.range or table.sensitivity or table.characteristic,
        "bits": "bits" in table.model_fields_set,
        "cover": not cover.assumed,
    }
    return {name: "the sensor file" for name, given in stated.items() if given}


def _build_cover(tables: SensorTables, array: TexelArray, folder: Path) -> tuple[TexelArray, Cover | SolidCover]:
    """Make the cover of a sensor file, and return the texels and the cover.

    If the file asks for it (`array.project`), the texels are moved to the base of a solid cover.
    """
    table = tables.cover
    if isinstance(table, CurvedCoverTable):
        from meshes.solids.solid_mesh import check_on_base
        from validation.sensor_file.curved_cover import build_solid, project_texels

        solid = build_solid(table, folder)
        placed = project_texels(array, solid) if tables.array.project else array
        if solid.base_triangles is not None:
            with at("array: "):
                check_on_base(solid.base_triangles, solid.thickness, placed)
        return placed, solid
    if tables.array.project:
        raise InputError("array.project: is for curved covers; leave it out")
    cover = table.make()
    _refuse_uncovered(array, cover)
    if cover.size is not None and array.regular and array.margin is None:
        half = np.abs(array.centres[0, :2]) + np.array(array.pitch) / 2
        x, y = np.maximum(np.array(cover.size) / 2 - half, 0.0).tolist()
        array = dataclasses.replace(array, margin=(x, y))
    return array, cover


def _refuse_uncovered(array: TexelArray, cover: Cover) -> None:
    """Refuse texels that lie beside a cover of limited size; the cover's middle lies over the array's origin.

    Raises:
        InputError: If an active texel is not wholly under the cover.
    """
    if cover.size is None or not array.planar:
        return
    reach = np.abs(array.centres[array.active, :2]) + np.array(array.texel_size) / 2
    out = np.flatnonzero((reach > np.array(cover.size) / 2 * (1 + 1e-9)).any(axis=1))
    if len(out):
        first = np.flatnonzero(array.active)[out[0]]
        needed, given = (" x ".join(f"{1e3 * edge:.4g} mm" for edge in pair) for pair in (2 * reach.max(0), cover.size))
        raise InputError(
            f"cover.size: {given} leaves {len(out)} texels uncovered in part or whole, the first is number {first}; "
            f"the middle of the cover lies over the array's origin, so the texels need {needed}"
        )


def build_array(table: ArrayTable, *, name: str, folder: Path) -> TexelArray:
    """Make the texels that the table `[array]` of a sensor file describes: a grid, or positions of a CSV file.

    If a table with positions has no rows and columns, the tactile image is one row of texels in the order of the list.

    Args:
        table: The table `[array]`.
        name: Name of the array if the table has none.
        folder: Folder of the sensor file; the path `positions` in the table is relative to it.

    Raises:
        InputError: If the mask or the positions do not match rows x columns, or texels overlap.
    """
    if table.positions is None:
        rows, columns, pitch = table.rows or 0, table.columns or 0, table.pitch or (0.0, 0.0)  # required by the schema
        with at("array: "):
            check_texel_count(rows, columns)
        centres = normals = None
    else:
        path = folder / table.positions
        if not path.is_file():
            raise InputError(f"array.positions: no such file: {path}; {_EXAMPLE}")
        with at(f"array.positions: {path}"):
            centres, normals = _read_positions(path, table.unit or 1.0)
        count = len(centres)
        rows, columns = table.rows or 1, table.columns or count
        if rows * columns != count:
            raise InputError(
                f"array.positions: {path} holds {count} texels, rows x columns is {rows * columns}; {_EXAMPLE}"
            )
        pitch = table.pitch or (table.texel_size if count == 1 else None) or _smallest_spacing(centres, normals)
    active, size, name = _read_mask(table, rows, columns), table.texel_size or pitch, table.name or name
    with at("array: "):
        array = TexelArray.grid(rows, columns, pitch, texel_size=size, active=active, name=name, margin=table.margin)
        if centres is not None and normals is not None:
            array = dataclasses.replace(array, centres=centres, normals=normals)
    if array.planar:
        _refuse_overlap(array)
    return array


def _find_nearest(places: FloatArray, norm: float) -> tuple[FloatArray, npt.NDArray[np.intp]]:
    """Find the nearest neighbour of each of n places: its distance, shape (n,) [m], and its index, shape (n,).

    A search tree is used, because the distances of all pairs of ten thousand texels would fill the memory.
    """
    from scipy.spatial import cKDTree

    distances, indices = cKDTree(places).query(places, k=2, p=norm)
    return np.asarray(distances)[:, 1], np.asarray(indices)[:, 1]


def _smallest_spacing(centres: FloatArray, normals: FloatArray) -> tuple[float, float]:
    """Compute the largest edge length of equal squares, one centred on each texel, that do not overlap.

    For a flat array this is the smallest distance between the centres of two texels, in the maximum norm of x and y.
    The texels of a curved array have no common x and y; there the Euclidean distance is used, which is at least as
    large.

    Args:
        centres: Centres of the n texels, shape (n, 3) [m].
        normals: Unit normals of the texels, shape (n, 3) [-].

    Returns:
        The edge length, twice: along x and along y [m].

    Raises:
        InputError: If there is only one texel, or two texels have the same centre.
    """
    if len(centres) < 2:  # noqa: PLR2004 -- a distance needs two texels
        raise InputError('array.texel_size: is missing, and one texel has no neighbour; write texel_size = "2 mm"')
    flat = bool(np.allclose(normals, [0, 0, 1]) and np.ptp(centres[:, 2]) < _SAME_HEIGHT)
    distances, _ = _find_nearest(centres[:, :2], np.inf) if flat else _find_nearest(centres, 2.0)
    if not (distance := float(distances.min())) > 0:
        raise InputError("array.positions: two texels have the same centre; every texel needs its own")
    return (distance, distance)


def _refuse_overlap(array: TexelArray) -> None:
    """Refuse active texels that overlap, because force on the common area would count twice.

    Raises:
        InputError: If two active texels overlap.
    """
    places = array.centres[array.active, :2] / np.array(array.texel_size)
    if len(places) < 2:  # noqa: PLR2004 -- an overlap needs two texels
        return
    distances, neighbours = _find_nearest(places, np.inf)
    near = np.flatnonzero(distances < 1 - 1e-6)
    if len(near):
        pair = sorted((int(near[0]), int(neighbours[near[0]])))
        first, second = np.flatnonzero(array.active)[pair].tolist()
        x, y = (f"{1e3 * edge:.4g} mm" for edge in array.texel_size)
        raise InputError(
            f"array: texels {first} and {second} overlap, each {x} by {y}; "
            "write a smaller array.texel_size, or move them further apart"
        )


def _read_mask(table: ArrayTable, rows: int, columns: int) -> npt.NDArray[np.bool_] | None:
    """Read the mask of the table `[array]`.

    Returns:
        Whether each texel measures, shape (rows, columns); None if the table has no mask, so that all texels measure.

    Raises:
        InputError: If the mask does not have `rows` lines of `columns` entries 0 or 1.
    """
    if table.mask is None:
        return None
    if len(table.mask) != rows or any(len(line) != columns or set(line) - {"0", "1"} for line in table.mask):
        example = "0" + "1" * (columns - 1)
        raise InputError(
            f"array.mask: must have {rows} rows of {columns} entries 0 or 1, "
            f"row 0 (smallest y) first; write for example '{example}' for one row"
        )
    return np.asarray(np.array(table.mask) == "1")


def _read_positions(path: Path, unit: float) -> tuple[FloatArray, FloatArray]:
    """Read the positions of n texels from a CSV file.

    Args:
        path: The file.
        unit: Length of one unit of its coordinates [m].

    Returns:
        Centres of the texels, shape (n, 3) [m], and their unit normals, shape (n, 3) [-].

    Raises:
        InputError: If the file has other columns, or holds too many texels or text that is no number.
            The message repeats nothing of the file: a sensor file from somebody else may name any file.
    """
    try:
        text = read_text(path, most=_MOST_BYTES)
    except FileLimitError as error:
        raise InputError(f" {error}; {_EXAMPLE}") from None
    first, *lines = [line.split(",") for line in text.splitlines() if line.strip()] or [[]]
    width = len(first)
    if tuple(entry.strip() for entry in first) not in (_COLUMNS[:3], _COLUMNS):
        raise InputError(f" begins with another line; {_EXAMPLE}")
    if not 1 <= len(lines) <= MOST_TEXELS:
        raise InputError(f" holds {len(lines)} texels; 1..{MOST_TEXELS} are supported; {_EXAMPLE}")
    numbers = np.full((len(lines), width), np.nan)
    for number, line in enumerate(lines):
        try:
            numbers[number] = [float(entry) for entry in line]
        except ValueError:  # The line has an entry that is no number, or another number of entries.
            numbers[number] = np.nan
        if not np.isfinite(numbers[number]).all() or len(line) != width:
            raise InputError(f": texel {number + 1} is not {width} numbers; {_EXAMPLE}")
    centres = unit * numbers[:, :3]
    far = np.flatnonzero(np.abs(centres).max(axis=1) > _FARTHEST)
    if len(far):
        raise InputError(
            f": texel {far[0]} is farther than {_FARTHEST:g} m from the origin; state the unit of the file, for "
            'example unit = "mm"'
        )
    normals = numbers[:, 3:].copy() if width > 3 else np.tile([0.0, 0.0, 1.0], (len(numbers), 1))  # noqa: PLR2004 -- x, y, z
    return centres, normals
