"""Base of results: frozen models that write themselves as JSON and read themselves back."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict

from validation.json_values import json_text

#: An array of numbers as a field of a result; null in JSON becomes NaN.
Numbers = Annotated[np.ndarray[Any, np.dtype[np.float64]], BeforeValidator(lambda v: np.asarray(v, dtype=np.float64))]
#: An array of indices as a field of a result.
Indices = Annotated[np.ndarray[Any, np.dtype[np.intp]], BeforeValidator(lambda v: np.asarray(v, dtype=np.intp))]


class Result(BaseModel):
    """A result whose fields are the keys of its JSON object."""

    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)

    def as_json(self) -> dict[str, Any]:
        """Return the fields by name, as numbers, text, arrays and nested dicts."""
        return self.model_dump()

    def write(self, path: str | Path) -> Path:
        """Write the result as a JSON file, and return its path; NaN becomes null."""
        target = Path(path)
        target.write_text(json_text(self.as_json()) + "\n", encoding="utf-8")
        return target

    @classmethod
    def read(cls, path: str | Path) -> Self:
        """Read a result from a JSON file.

        Raises:
            OSError: If the file cannot be read.
            ValueError: If it does not hold such a result.
        """
        return cls.model_validate_json(Path(path).read_text(encoding="utf-8"))

    def __eq__(self, other: object) -> bool:
        """Return whether the other result writes the same JSON."""
        return (
            type(self) is type(other)
            and isinstance(other, Result)
            and json_text(self.as_json()) == json_text(other.as_json())
        )

    __hash__ = None  # type: ignore[assignment]
