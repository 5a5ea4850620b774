"""The parameters of one sensor, and the folder that holds them: `parameters.toml` beside `cover.npz`.

The TOML file holds everything but the large tables, in SI units: array, point spread, filter, electronics, provenance.
`cover.npz` holds the large tables: the spread operator `[texel, loaded texel]`, the compliance and influence of the
cover between cells smaller than a texel, and any further tables.  The TOML file contains the sha256 of `cover.npz`.
No file contains pickled objects.  If a save is interrupted, the folder still holds a matching pair of files, either
the old pair or the new one.

The two files of a parameters folder, `parameters.toml` and `cover.npz`: replaced together, read within limits.
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
#: Largest accepted number of bits of a converter.
_MOST_BITS = 32
#: Folder that holds one parameters folder for each sensor that comes with the package.
SENSORS = Path(__file__).parent / "sensors"
#: Name of the spread operator among the tables of the npz file.
_OPERATOR = "operator"


@dataclass(frozen=True, kw_only=True)
class _Section:
    """How one kind of surface is stored.

    Attributes:
        name: Section of the TOML file, which holds the fields that are no arrays.
        surface: The class.
        tables: Fields that are arrays, with the names of their tables in the npz file.
        number: Type of the numbers of these tables.  The compliance of points is dense; four bytes for each number
            halve the file, with an error of 1e-7.
    """

    name: str
    surface: type[CoverCells | CoverPoints]
    tables: Mapping[str, str]
    number: type[np.floating[Any]]


def _name_tables(prefix: str, *fields: str) -> dict[str, str]:
    """Name the table in the npz file of each field."""
    return {name: f"{prefix}_{name}" for name in fields}


#: How the surfaces are stored.  The names of the sections are those of the first version of the format.
_SECTIONS = (
    _Section(
        name="cells",
        surface=CoverCells,
        tables=_name_tables(
            "cells",
            *("compliance", "influence", "table", "loads", "load_depths", "loaded_compliance", "loaded_influence"),
        ),
        number=np.float64,
    ),
    _Section(
        name="curved",
        surface=CoverPoints,
        tables=_name_tables("curved", "points", "normals", "influence", "compliance"),
        number=np.float32,
    ),
)
#: Value of `validity` in the TOML file if the range of the fast model is not stated.
_NOT_STATED = "not stated"
#: Names of tables that the format itself uses; further tables must not have them.
_RESERVED = (_OPERATOR, *(table for section in _SECTIONS for table in section.tables.values()))


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

    def __post_init__(self) -> None:
        """Check that spread operator, gains and surface fit the array.

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
            section = _section_of(self.surface)
            for name, stored in section.tables.items():
                if (table := getattr(self.surface, name)) is not None:
                    tables[stored] = table.astype(section.number)
        packed = pack_npz(tables)
        text = tomli_w.dumps(_describe(self, hashlib.sha256(packed).hexdigest()))
        replace_pair(target, packed, text.encode())
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
    if document.take("format") != FORMAT:
        raise ParametersError(f"{document.path}: format is {document.take('format')!r}; this version reads {FORMAT}")
    with document.section("array"):
        array = _build_array(document)
    with document.section("cover"):
        name, sha256 = document.take("cover.file"), document.take("cover.sha256")
        if name != NPZ_NAME:
            raise ValueError(f"file must be {NPZ_NAME!r}")
        tables = read_tables(document.path.parent, sha256, array.count)
    operator = tables.pop(_OPERATOR, np.zeros(0))
    if operator.shape != (array.count, array.count):
        raise ParametersError(
            f"{document.path.parent / NPZ_NAME}: {_OPERATOR!r} has shape {operator.shape}; {array.count} texels need "
            f"{(array.count, array.count)}"
        )
    with document.section("spread"):
        spread = _build_spread(document.take("spread"), operator)
    with document.section("electronics"):
        electronics = _build_electronics(document)
    with document.section("filter"):
        low_pass = Butterworth(**document.take("filter")) if "filter" in document.values else None
    surface = None
    for section in _SECTIONS:
        if section.name in document.values:
            with document.section(section.name):
                stored: dict[str, Any] = {name: tables[key] for name, key in section.tables.items() if key in tables}
                values: dict[str, Any] = {
                    key: tuple(value) if isinstance(value, list) else value
                    for key, value in document.take(section.name).items()
                }
                surface = section.surface(**values, **stored)
    with document.section("validity"):
        stated = document.values.get("validity", _NOT_STATED)
        validity = None if stated == _NOT_STATED else Validity(**stated)
    with document.section("parameters"):
        return Parameters(
            array=array,
            spread=spread,
            electronics=electronics,
            filter=low_pass,
            provenance=dict(document.values.get("provenance", {})),
            surface=surface,
            validity=validity,
            tables={name: table for name, table in tables.items() if name not in _RESERVED},
        )


class _Document:
    """A parsed `parameters.toml`, whose error messages name the file and the place in the file, in one line.

    Attributes:
        path: Path of the TOML file.
        values: Content of the TOML file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.values = read_values(path)

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
    document: dict[str, Any] = {
        "format": FORMAT,
        "array": _describe_array(parameters.array),
        "spread": _describe_spread(parameters.spread),
        "electronics": _describe_dataclass(parameters.electronics),
        "cover": {"file": NPZ_NAME, "sha256": sha256},
    }
    if parameters.filter is not None:
        document["filter"] = _describe_dataclass(parameters.filter)
    if parameters.surface is not None:
        section = _section_of(parameters.surface)
        document[section.name] = _convert_values(
            {
                each.name: getattr(parameters.surface, each.name)
                for each in dataclasses.fields(parameters.surface)
                if each.name not in section.tables
            }
        )
    document["validity"] = _NOT_STATED if parameters.validity is None else _describe_dataclass(parameters.validity)
    if parameters.provenance:
        document["provenance"] = _convert_values(parameters.provenance)
    return document


def _describe_array(array: TexelArray) -> dict[str, Any]:
    """Convert an array to TOML values; mask, positions and normals only if they differ from those of a full grid."""
    values: dict[str, Any] = {
        "name": array.name,
        "rows": array.rows,
        "columns": array.columns,
        "pitch": list(array.pitch),
        "texel_size": list(array.texel_size),
    }
    if not array.active.all():
        values["active"] = array.image(array.active).astype(int).tolist()
    grid = TexelArray.grid(array.rows, array.columns, array.pitch)
    if not (np.array_equal(array.centres, grid.centres) and np.array_equal(array.normals, grid.normals)):
        values["centres"] = array.centres.tolist()
        values["normals"] = array.normals.tolist()
    return values


def _build_array(document: _Document) -> TexelArray:
    """Build the array from the section `[array]` of the TOML file; this inverts `_describe_array`."""
    pitch, size = document.take("array.pitch"), document.take("array.texel_size")
    table = document.take("array")
    check_texel_count(document.take("array.rows"), document.take("array.columns"))
    check_type("name", document.take("array.name"), str, "a text")
    grid = TexelArray.grid(
        document.take("array.rows"),
        document.take("array.columns"),
        (pitch[0], pitch[1]),
        texel_size=(size[0], size[1]),
        active=table.get("active"),
        name=document.take("array.name"),
    )
    if "centres" not in table:
        return grid
    return dataclasses.replace(
        grid,
        centres=np.array(table["centres"], dtype=np.float64),
        normals=np.array(document.take("array.normals"), dtype=np.float64),
    )


def _describe_spread(spread: Spread) -> dict[str, Any]:
    """Convert a point spread to TOML values: a Gaussian to its numbers, others to their source (their table is npz)."""
    if isinstance(spread, Gaussian):
        return {"kind": "gaussian", **_describe_dataclass(spread)}
    return {"kind": "operator", "source": getattr(spread, "source", type(spread).__name__)}


def _build_spread(table: Mapping[str, Any], operator: FloatArray) -> Spread:
    """Build the point spread from the section `[spread]` and the operator."""
    values = dict(table)
    match values.pop("kind", None):
        case "gaussian":
            kernel = Gaussian(**values)
            if max(kernel.ksize_x, kernel.ksize_y) > MOST_TEXELS:
                raise ValueError(f"ksize must be at most {MOST_TEXELS} texels")
            return kernel
        case "operator":
            return Tabulated(matrix=operator, **values)
        case kind:
            raise ValueError(f"kind is {kind!r}; it must be 'gaussian' or 'operator'")


def _build_electronics(document: _Document) -> Electronics:
    """Build the electronics from the section `[electronics]`; warn if an earlier version wrote it."""
    table = document.take("electronics")
    values: dict[str, Any] = {key: tuple(value) if isinstance(value, list) else value for key, value in table.items()}
    if not isinstance(bits := values.get("bits", 1), int) or not 1 <= bits <= _MOST_BITS:
        raise ValueError(f"bits must be a whole number 1..{_MOST_BITS}, not {bits!r}")
    if "calibrated" not in values:
        _LOG.warning(
            "%s: [electronics] has no `calibrated`, so counts follow the texel force; derive anew", document.path
        )
    return Electronics(**values)


def _section_of(surface: Surface) -> _Section:
    """Return how a surface is stored."""
    return next(section for section in _SECTIONS if isinstance(surface, section.surface))


def _describe_dataclass(instance: Any) -> dict[str, Any]:  # noqa: ANN401 -- any dataclass instance
    """Convert the fields of a dataclass to TOML values, see `_convert_values`."""
    return _convert_values(dataclasses.asdict(instance))


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


#: Names of the two files in a parameters folder.
TOML_NAME = "parameters.toml"
NPZ_NAME = "cover.npz"
#: Largest accepted size of the TOML file; texels anywhere in space take most of it, ten thousand about 1.5 MiB [bytes].
_MOST_TOML_BYTES = 3 * 2**20
#: Largest accepted size of all tables of the npz file together, besides the operator of n x n numbers [bytes].
_MOST_TABLE_BYTES = 2**27


def replace_pair(folder: Path, packed: bytes, text: bytes) -> None:
    """Replace `parameters.toml` and `cover.npz` such that a reader finds a matching pair at every moment.

    The old TOML file contains the hash of the old npz file, so a copy of the old npz file is kept until the TOML file
    is replaced too.

    Args:
        folder: The parameters folder.
        packed: New content of the npz file.
        text: New content of the TOML file.

    Raises:
        OSError: If the folder cannot be written; the old pair of files can still be read then.
    """
    tables = folder / NPZ_NAME
    if tables.exists() and (old := tables.read_bytes()) != packed:
        atomic_file.replace(_path_of_copy(tables, hashlib.sha256(old).hexdigest()), [old])
    atomic_file.replace(tables, [packed])
    atomic_file.replace(folder / TOML_NAME, [text])
    for copy in tables.parent.glob(f"{tables.stem}.????????????????{tables.suffix}"):
        copy.unlink(missing_ok=True)
    atomic_file.sweep(folder)


def _path_of_copy(tables: Path, sha256: str) -> Path:
    """Return the path of the copy of an old npz file with a given hash; it exists while both files are replaced."""
    return tables.with_name(f"{tables.stem}.{sha256[:16]}{tables.suffix}")


def read_values(path: Path) -> dict[str, Any]:
    """Read the TOML file.

    Raises:
        ParametersError: If it cannot be read, or is no TOML within the limits on size and depth.
    """
    content = _read_bytes(path, _MOST_TOML_BYTES)
    try:
        return parse_toml(content.decode("utf-8-sig"))
    except (FileLimitError, UnicodeDecodeError) as error:
        raise ParametersError(f"{path}: not readable as TOML: {error}") from error


def read_tables(folder: Path, sha256: object, texels: int) -> dict[str, FloatArray]:
    """Read the tables of the npz file.

    Args:
        folder: The parameters folder.
        sha256: Hash of the npz file that the TOML file states.
        texels: Number of texels n, on which the largest accepted size depends.

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
