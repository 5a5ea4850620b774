"""The parameters of one sensor, and the folder that holds them: `parameters.toml` beside `cover.npz`.

The TOML file holds everything but the large tables, in SI units: array, point spread, filter, electronics, provenance.
`cover.npz` holds the large tables: the spread operator `[texel, loaded texel]`, the compliance and influence of the
cover between cells smaller than a texel, and any further tables.  The TOML file contains the sha256 of `cover.npz`.
No file contains pickled objects.  If a save is interrupted, the folder still holds a matching pair of files, either
the old pair or the new one.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import logging
import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fastmodel.errors import FastModelError, ParametersError, check_type
from fastmodel.signal.butterworth import Butterworth
from fastmodel.signal.electronics import Electronics
from fastmodel.signal.point_spread import Gaussian, Spread, Tabulated
from fastmodel.surface import CoverCells, CoverPoints, Surface
from fastmodel.validity import Validity
from meshes import TexelArray, atomic_file
from meshes.array import MOST_TEXELS, check_texel_count
from meshes.array_types import FloatArray
from meshes.bounded_file import FileLimitError, pack_npz, parse_toml, read_bytes, unpack_npz

_LOG = logging.getLogger(__name__)

#: Version of the format of a parameters folder; `load` refuses other versions.
FORMAT = 1
#: Folder that holds one parameters folder for each sensor that comes with the package.
SENSORS = Path(__file__).parent / "sensors"
#: Name of the file with parameters as text in a parameters folder.
TOML_NAME = "parameters.toml"
#: Name of the file with large tables in a parameters folder.
NPZ_NAME = "cover.npz"
#: Largest accepted size of the TOML file [bytes].  Texels at arbitrary positions take most of it; ten thousand take
#: about 1.5 MiB.
_MOST_TOML_BYTES = 3 * 2**20
#: Largest accepted size of all tables of the npz file together, besides the operator of n x n numbers [bytes].
_MOST_TABLE_BYTES = 2**27
#: Name of the spread operator among the tables of the npz file.
_OPERATOR = "operator"
#: Value of `validity` in the TOML file if the range of the fast model is not stated.
_NOT_STATED = "not stated"
#: Class of the object that a section of the TOML file holds, by the name of the section.
_CLASSES: dict[str, type] = {
    "electronics": Electronics,
    "filter": Butterworth,
    "validity": Validity,
    CoverCells.section: CoverCells,
    CoverPoints.section: CoverPoints,
}


def _name_tables(kind: type) -> dict[str, str]:
    """Return the name of the table in the npz file for each field of a class that is an array, by field name."""
    section = next(name for name, each in _CLASSES.items() if each is kind)
    return {each.name: f"{section}_{each.name}" for each in dataclasses.fields(kind) if "Array" in str(each.type)}


#: Names of tables in the npz file that the format itself uses; tables of the user must not have these names.
_RESERVED = (_OPERATOR, *(table for kind in _CLASSES.values() for table in _name_tables(kind).values()))


@dataclass(frozen=True, kw_only=True, eq=False)
class Parameters:
    """The parameters of a tactile array with its cover.

    Attributes:
        array: The texels and their positions.
        spread: The point spread of the cover, from contact forces on texels to forces that the texels measure.
        electronics: The conversion of texel forces to counts.
        filter: Low-pass filter on the force of every texel; None for no filter.
        provenance: Origin of the numbers: estimator, versions, hashes, assumptions.
        tables: Further arrays about the cover, by name, that are stored in `cover.npz`, for example a point response.
        surface: Compliance and influence of the cover: between cells smaller than a texel of a flat array, for the
            contact methods `cover` and `foundation`, or between points of a mesh, for `curved`; None if unknown.
        validity: The range in which the contact method `cover` agrees with the finite elements; None if not stated.
    """

    array: TexelArray
    spread: Spread
    electronics: Electronics
    filter: Butterworth | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)
    tables: Mapping[str, FloatArray] = field(default_factory=dict)
    surface: Surface | None = None
    validity: Validity | None = None

    @property
    def ends_at_texels(self) -> bool:
        """Whether plate and contact grid end at the texels: the cover does, and the array states no margin."""
        return self.surface is not None and self.surface.margin is not None and self.array.margin is None

    def __post_init__(self) -> None:
        """Check the types of the parts, and that spread operator, gains and surface fit the array.

        Raises:
            FastModelError: If a part has a wrong type.
            FastModelError: If spread operator, gains or surface are for another array.
            ParametersError: If a table has a name that the format uses itself.
        """
        check_type("array", self.array, TexelArray, "a meshes.TexelArray")
        check_type("electronics", self.electronics, Electronics, "a fastmodel.Electronics")
        check_type("filter", self.filter, (Butterworth, type(None)), "a fastmodel.Butterworth or None")
        if isinstance(self.spread, Tabulated):
            self.spread.operator(self.array)
        gains = self.electronics.gains
        if gains is not None and len(gains) != self.array.count:
            raise FastModelError(f"there are gains for {len(gains)} texels; the array has {self.array.count}")
        if self.surface is not None:
            self.surface.check(self.array)
        for name in _RESERVED:
            if name in self.tables:
                raise ParametersError(f"a table must not be named {name!r}; the format uses that name itself")

    def save(self, folder: str | Path) -> Path:
        """Write `parameters.toml` and `cover.npz` into a folder, and make the folder if it does not exist.

        Args:
            folder: The folder to write to.

        Returns:
            The path of `parameters.toml`.

        Raises:
            OSError: If the folder cannot be written.
        """
        # Imported here, because only writing needs the package tomli_w.
        import tomli_w

        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        tables = {_OPERATOR: self.spread.operator(self.array), **self.tables}
        if self.surface is not None:
            for name, stored in _name_tables(type(self.surface)).items():
                if (table := getattr(self.surface, name)) is not None:
                    tables[stored] = table.astype(self.surface.number)
        packed = pack_npz(tables)
        text = tomli_w.dumps(_describe(self, hashlib.sha256(packed).hexdigest()))
        _replace_pair(target, packed, text.encode())
        return target / TOML_NAME


def list_sensors() -> tuple[str, ...]:
    """List the names of the sensors whose parameters come with the package."""
    return tuple(sorted(path.parent.name for path in SENSORS.glob(f"*/{TOML_NAME}")))


def load(sensor: str | Path) -> Parameters:
    """Read the parameters of a sensor.

    Args:
        sensor: Name of a sensor that comes with the package (see `list_sensors`), or a folder that `Parameters.save`
            wrote, or the path of its `parameters.toml`.  A name that belongs to both a sensor and a folder means the
            sensor; write `./name` for the folder.

    Raises:
        FastModelError: If the argument is neither a text nor a path.
        ParametersError: If the name is unknown, or a file is missing, damaged, of another format, or holds bad values.
    """
    check_type("sensor", sensor, (str, os.PathLike), "the name of a sensor or the path of a parameters folder")
    path = SENSORS / sensor if isinstance(sensor, str) and sensor in list_sensors() else Path(sensor)
    if not path.exists():
        raise ParametersError(
            f"{sensor}: no such folder; a folder with {TOML_NAME} and {NPZ_NAME} is needed, or one of the sensors "
            f"{', '.join(list_sensors())}"
        )
    document = _Document(path if path.suffix == ".toml" else path / TOML_NAME)
    if "format" not in document.values and "array" in document.values:
        raise ParametersError(
            f"{path}: describes a sensor; run `softcover derive {path} --out FOLDER`, and load that folder"
        )
    if document.take("format") != FORMAT:
        raise ParametersError(f"{document.path}: format is {document.take('format')!r}; this version reads {FORMAT}")
    with document.section("array"):
        array = _build_array(document)
    with document.section("cover"):
        if document.take("cover.file") != NPZ_NAME:
            raise ValueError(f"file must be {NPZ_NAME!r}")
        tables = _read_tables(document.path.parent, document.take("cover.sha256"), array.count)
    with document.section("spread"):
        spread = _build_spread(dict(document.take("spread")), tables.pop(_OPERATOR, np.zeros(0)), array)
    if "calibrated" not in document.take("electronics"):
        _LOG.warning("%s: [electronics] has no `calibrated`: counts follow the texel force; derive anew", document.path)
    parts: dict[str, Any] = {}
    for name, kind in _CLASSES.items():
        if name in document.values and document.values[name] != _NOT_STATED:
            with document.section(name):
                values = {
                    key: tuple(value) if isinstance(value, list) else value
                    for key, value in document.take(name).items()
                }
                stored = {key: tables.pop(table) for key, table in _name_tables(kind).items() if table in tables}
                needed = {each.name for each in dataclasses.fields(kind) if each.default is dataclasses.MISSING}
                if lacks := sorted(needed & _name_tables(kind).keys() - stored.keys()):
                    raise ValueError(f"{NPZ_NAME} holds no {', '.join(lacks)}; derive these parameters anew")
                parts["surface" if kind in (CoverCells, CoverPoints) else name] = kind(**values, **stored)
    with document.section("parameters"):
        provenance = dict(document.values.get("provenance", {}))
        return Parameters(array=array, spread=spread, provenance=provenance, tables=tables, **parts)


class _Document:
    """A parsed `parameters.toml`, whose error messages name the file and the place in the file, in one line.

    Attributes:
        path: Path of the TOML file.
        values: Content of the TOML file.
    """

    def __init__(self, path: Path) -> None:
        """Read a `parameters.toml`.

        Raises:
            ParametersError: If the file cannot be read, or is no TOML within the limits on size and depth.
        """
        self.path = path
        try:
            self.values = parse_toml(_read_bytes(path, _MOST_TOML_BYTES).decode("utf-8-sig"))
        except (FileLimitError, UnicodeDecodeError) as error:
            raise ParametersError(f"{path}: not readable as TOML: {error}") from error

    def take(self, key: str) -> Any:  # noqa: ANN401 -- TOML values
        """Return the value under a dotted key such as `array.rows`; raise a `ParametersError` if it is missing."""
        value: Any = self.values
        for part in key.split("."):
            if not isinstance(value, Mapping) or part not in value:
                raise ParametersError(f"{self.path}: {key} is missing")
            value = value[part]
        return value

    @contextlib.contextmanager
    def section(self, name: str) -> Iterator[None]:
        """Convert errors raised in a `with` block to a `ParametersError` that names the file and a section."""
        try:
            yield
        except ParametersError:
            raise
        except (TypeError, ValueError, LookupError, ArithmeticError, AttributeError) as error:
            raise ParametersError(f"{self.path}: [{name}] {error}") from error


def _describe(parameters: Parameters, sha256: str) -> dict[str, Any]:
    """Convert parameters to the content of `parameters.toml`.

    Args:
        parameters: The parameters of the sensor.
        sha256: Hash of `cover.npz`.
    """
    array, spread, surface = parameters.array, parameters.spread, parameters.surface
    layout = {name: getattr(array, name) for name in ("name", "rows", "columns", "pitch", "texel_size")}
    if not array.active.all():
        layout["active"] = array.image(array.active).astype(int)
    if array.margin is not None:
        layout["margin"] = array.margin
    grid = TexelArray.grid(array.rows, array.columns, array.pitch)
    if not (np.array_equal(array.centres, grid.centres) and np.array_equal(array.normals, grid.normals)):
        layout |= {"centres": array.centres, "normals": array.normals}
    document: dict[str, Any] = {"format": FORMAT, "array": layout}
    if isinstance(spread, Gaussian):
        document["spread"] = {"kind": "gaussian", **vars(spread)}
    else:  # The table of any other point spread is in the npz file.
        document["spread"] = {"kind": "operator", "source": getattr(spread, "source", type(spread).__name__)}
    document["electronics"] = vars(parameters.electronics)
    document["cover"] = {"file": NPZ_NAME, "sha256": sha256}
    if parameters.filter is not None:
        document["filter"] = vars(parameters.filter)
    if surface is not None:
        tables = _name_tables(type(surface))
        named = (each.name for each in dataclasses.fields(surface) if each.name not in tables)
        document[surface.section] = {name: getattr(surface, name) for name in named}
    document["validity"] = _NOT_STATED if parameters.validity is None else vars(parameters.validity)
    if parameters.provenance:
        document["provenance"] = parameters.provenance
    return _convert_values(document)


def _convert_values(values: Mapping[str, Any]) -> dict[str, Any]:
    """Convert tuples and numpy values to TOML values, and omit fields that are None."""
    converted: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, Mapping):
            converted[key] = _convert_values(value)
        elif isinstance(value, np.generic | np.ndarray):
            converted[key] = value.tolist()
        elif value is not None:
            converted[key] = list(value) if isinstance(value, tuple) else value
    return converted


def _build_array(document: _Document) -> TexelArray:
    """Build the array from the section `[array]` of the TOML file."""
    take = {name: document.take(f"array.{name}") for name in ("rows", "columns", "pitch", "texel_size", "name")}
    table = document.take("array")
    check_texel_count(take["rows"], take["columns"])
    check_type("name", take["name"], str, "a text")
    for name in ("pitch", "texel_size"):
        take[name] = (take[name][0], take[name][1])
    margin = tuple(table["margin"]) if "margin" in table else None
    grid = TexelArray.grid(**take, active=table.get("active"), margin=margin)
    if "centres" not in table:
        return grid
    centres, normals = (np.array(document.take(f"array.{name}"), dtype=np.float64) for name in ("centres", "normals"))
    return dataclasses.replace(grid, centres=centres, normals=normals)


def _build_spread(table: dict[str, Any], operator: FloatArray, array: TexelArray) -> Spread:
    """Build the point spread of an array from the section `[spread]` of the TOML file and the operator in the npz file.

    Raises:
        ValueError: If the operator is for another number of texels, or the section has bad values.
    """
    if operator.shape != (array.count, array.count):
        raise ValueError(
            f"{_OPERATOR!r} in {NPZ_NAME} has shape {operator.shape}; {array.count} texels need "
            f"{(array.count, array.count)}"
        )
    match table.pop("kind", None):
        case "gaussian":
            kernel = Gaussian(**table)
            if max(kernel.ksize_x, kernel.ksize_y) > MOST_TEXELS:
                raise ValueError(f"ksize must be at most {MOST_TEXELS} texels")
            return kernel
        case "operator":
            return Tabulated(matrix=operator, **table)
        case kind:
            raise ValueError(f"kind is {kind!r}; it must be 'gaussian' or 'operator'")


def _replace_pair(folder: Path, packed: bytes, text: bytes) -> None:
    """Replace both files of a folder, npz and TOML, such that a reader finds a matching pair at every moment.

    The old TOML file contains the hash of the old npz file, so a copy of the old npz file is kept until the TOML file
    is replaced too.

    Raises:
        OSError: If the folder cannot be written; the old pair of files can still be read then.
    """
    tables = folder / NPZ_NAME
    if tables.exists() and (old := tables.read_bytes()) != packed:
        atomic_file.replace(_path_of_copy(tables, hashlib.sha256(old).hexdigest()), [old])
    atomic_file.replace(tables, [packed])
    atomic_file.replace(folder / TOML_NAME, [text])
    for copy in folder.glob(_path_of_copy(tables, "?" * 16).name):
        copy.unlink(missing_ok=True)
    atomic_file.sweep(folder)


def _path_of_copy(tables: Path, sha256: str) -> Path:
    """Return the path of the copy of an old npz file with a given hash.

    The copy exists only while the npz file and the TOML file of a folder are replaced.
    """
    return tables.with_name(f"{tables.stem}.{sha256[:16]}{tables.suffix}")


def _read_tables(folder: Path, sha256: object, texels: int) -> dict[str, FloatArray]:
    """Read the tables of the npz file with the hash that the TOML file states; the accepted size grows with the texels.

    Raises:
        ParametersError: If the file cannot be read, has another hash, is damaged or too large.
        ValueError: If the stated hash is none.
    """
    if not isinstance(sha256, str) or not re.fullmatch("[0-9a-f]{64}", sha256):
        raise ValueError("sha256 must be a text of 64 hexadecimal digits")
    path, most = folder / NPZ_NAME, _MOST_TABLE_BYTES + 8 * texels**2
    packed = _read_bytes(path, most)
    if hashlib.sha256(packed).hexdigest() != sha256:
        copy = _path_of_copy(path, sha256)
        if not copy.exists():
            raise ParametersError(f"{path}: does not belong to {TOML_NAME} (sha256 differs); write both anew")
        packed = _read_bytes(copy, most)
    try:
        unpacked = unpack_npz(packed, most=most)
    except FileLimitError as error:
        raise ParametersError(f"{path}: {error}") from error
    return {name: np.asarray(table, dtype=np.float64) for name, table in unpacked.items()}


def _read_bytes(path: Path, most: int) -> bytes:
    """Read a file of at most `most` bytes; raise a `ParametersError` if it cannot be read or is larger."""
    try:
        return read_bytes(path, most=most)
    except FileLimitError as error:
        raise ParametersError(f"{path}: {error}") from error
    except OSError as error:
        message = f"{path}: {error.strerror}; a folder with {TOML_NAME} and {NPZ_NAME} is needed"
        raise ParametersError(message) from error
