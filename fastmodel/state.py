"""States of sensors as plain arrays, and the seeds of their noise.

`pack` converts nested values to a flat dict of arrays, which `numpy.savez` writes; `unpack` inverts this.  The keys are
paths, for example `reading/contact_forces`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from fastmodel.errors import FastModelError, check_type

#: A state: arrays by name.
State = dict[str, npt.NDArray[Any]]

#: Last part of a key that holds the name of a class.
_TYPE = "type"
#: Last part of a key that holds the length of a tuple.
_LENGTH = "length"
#: Mask of the lower 64 of 128 bits.
_LOW = (1 << 64) - 1


def pack(name: str, value: Any) -> State:  # noqa: ANN401 -- any of the types listed below
    """Convert a value to arrays.

    Args:
        name: Key of the value, or first part of the keys.
        value: An array, a number, a text, None, or a tuple, NamedTuple or dataclass of such values.
    """
    if value is None:
        return {}
    if dataclasses.is_dataclass(value):
        parts = {field.name: getattr(value, field.name) for field in dataclasses.fields(value) if field.init}
    elif hasattr(value, "_fields"):
        parts = value._asdict()
    elif isinstance(value, tuple):
        parts = {str(index): part for index, part in enumerate(value)}
        return {f"{name}/{_LENGTH}": np.array(len(value)), **_pack_parts(name, parts)}
    else:
        return {name: np.array(value)}
    return {f"{name}/{_TYPE}": np.array(type(value).__name__), **_pack_parts(name, parts)}


def _pack_parts(name: str, parts: Mapping[str, Any]) -> State:
    """Convert the parts of a value to arrays, see `pack`."""
    return {key: array for part, value in parts.items() for key, array in pack(f"{name}/{part}", value).items()}


def unpack(state: Mapping[str, npt.NDArray[Any]], name: str, types: Iterable[type] = ()) -> Any:  # noqa: ANN401
    """Convert arrays of a state to the value that `pack` converted.

    Args:
        state: The arrays by name.
        name: Key of the value, or first part of its keys.
        types: The dataclasses and NamedTuples that may occur.

    Returns:
        The value; None if the state holds no such key.

    Raises:
        FastModelError: If the arrays are not those of a value of these types.
    """
    known = {each.__name__: each for each in types}
    if f"{name}/{_TYPE}" in state:
        kind = known.get(str(state[f"{name}/{_TYPE}"]))
        if kind is None:
            raise FastModelError(f"state: {name!r} is of type {state[f'{name}/{_TYPE}']}, not one of {sorted(known)}")
        fields = kind._fields if hasattr(kind, "_fields") else [each.name for each in dataclasses.fields(kind)]
        found = {field: unpack(state, f"{name}/{field}", types) for field in fields}
        try:
            return kind(**{**found, **_find_defaults(kind, [field for field in fields if found[field] is None])})
        except (TypeError, ValueError, AttributeError) as error:
            raise FastModelError(f"state: {name!r} is not a {kind.__name__}: {error}") from error
    if f"{name}/{_LENGTH}" in state:
        return tuple(unpack(state, f"{name}/{index}", types) for index in range(int(state[f"{name}/{_LENGTH}"])))
    if name not in state:
        return None
    array = np.array(state[name])
    return array if array.ndim else array.item()


def _find_defaults(kind: type, missing: Iterable[str]) -> dict[str, Any]:
    """Return the defaults of missing fields that have one: a state stored before a field was added lacks it."""
    known = getattr(kind, "_field_defaults", None)
    if known is None:
        fields = dataclasses.fields(kind)
        known = {each.name: each.default for each in fields if each.default is not dataclasses.MISSING}
    return {field: known[field] for field in missing if field in known}


def take_array(
    state: Mapping[str, npt.NDArray[Any]], name: str, like: npt.NDArray[Any] | None = None
) -> npt.NDArray[Any]:
    """Return a copy of one array of a state.

    Args:
        state: The arrays by name.
        name: Key of the array.
        like: An array of the expected shape and type; None for any.

    Raises:
        FastModelError: If the array is missing or has another shape, or is not finite where whole numbers are stored.
    """
    if name not in state:
        raise FastModelError(f"state: {name!r} is missing; give a dict as Sensor.get_state() returns it")
    if like is None:
        return np.array(state[name])
    given = np.asarray(state[name])
    if like.dtype.kind in "iu" and given.dtype.kind == "f" and not np.isfinite(given).all():
        raise FastModelError(f"state: {name!r} is not finite")
    array = np.array(given, dtype=like.dtype)
    if array.shape != like.shape:
        raise FastModelError(f"state: {name!r} has shape {array.shape}; this sensor has {like.shape}")
    return array


def make_generator(seed: int | np.random.SeedSequence, name: str) -> np.random.Generator:
    """Make the random generator of the noise of one sensor.

    Sensors of other names get other numbers from the same seed.

    Args:
        seed: A number from 0 on, or a seed sequence.
        name: Name of the sensor in its model.

    Raises:
        FastModelError: If the seed is neither a whole number nor a seed sequence.
        FastModelError: If the seed is negative.
    """
    check_type("seed", seed, (int, np.integer, np.random.SeedSequence), "a whole number or a numpy.random.SeedSequence")
    if not isinstance(seed, np.random.SeedSequence):
        if seed < 0:
            raise FastModelError(f"seed must not be negative, not {seed}")
        seed = np.random.SeedSequence(int(seed))
    own = np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, *name.encode()), pool_size=seed.pool_size)
    return np.random.Generator(np.random.PCG64(own))


def pack_generator(generator: np.random.Generator) -> npt.NDArray[np.uint64]:
    """Return the state of a generator that `make_generator` made, shape (6,)."""
    found: Any = generator.bit_generator.state
    numbers = (found["state"]["state"], found["state"]["inc"])
    words = [word for number in numbers for word in (number >> 64, number & _LOW)]
    return np.array([*words, found["has_uint32"], found["uinteger"]], dtype=np.uint64)


def unpack_generator(words: npt.NDArray[np.uint64]) -> np.random.Generator:
    """Return a generator with the state that `pack_generator` returned, shape (6,)."""
    high, low, high_increment, low_increment, has_uint32, uinteger = (int(word) for word in words)
    bits = np.random.PCG64()
    bits.state = {
        "bit_generator": "PCG64",
        "state": {"state": high << 64 | low, "inc": high_increment << 64 | low_increment},
        "has_uint32": has_uint32,
        "uinteger": uinteger,
    }
    return np.random.Generator(bits)
