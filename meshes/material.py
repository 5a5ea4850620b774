"""Materials as names with numbers; the energies themselves live in `fem_reference`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType

#: Parameters of each model: name -> unit ("Pa" or "-").
MODELS: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "linear-elastic": {"youngs_modulus": "Pa"},
        "neo-hookean": {"shear_modulus": "Pa"},
        "mooney-rivlin": {"c10": "Pa", "c01": "Pa"},
        "yeoh": {"c1": "Pa", "c2": "Pa", "c3": "Pa"},
        "ogden": {"mu": "Pa", "alpha": "-"},
    }
)

#: Models of any number of terms: each of their parameters is a number, or one per term.
SERIES = frozenset({"ogden"})

Number = float | tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class Material:
    """An isotropic elastic material.

    Attributes:
        name: What to call it in reports.
        model: One of `MODELS`.
        parameters: The model's numbers in SI, as `MODELS` lists them; of a model in `SERIES` one number per term.
            Ogden: energy sum of 2 mu / alpha^2 (l1^alpha + l2^alpha + l3^alpha - 3).
        poisson_ratio: Small-strain Poisson ratio, 0..0.5 [-].
        source: Where the numbers come from.
        spread: Relative half-width of the modulus between sources, 0.5 for +-50 % [-].
        poisson_spread: Half-width of the Poisson ratio between sources [-].
    """

    name: str
    model: str
    parameters: Mapping[str, Number]
    poisson_ratio: float
    source: str = "given by the user"
    spread: float = 0.0
    poisson_spread: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            ValueError: If the model is unknown, a parameter is missing or the material would be unstable.
        """
        if self.model not in MODELS:
            raise ValueError(f"unknown material model {self.model!r}; known models: {', '.join(MODELS)}")
        wanted = set(MODELS[self.model])
        if wanted != set(self.parameters):
            raise ValueError(f"{self.model} takes {sorted(wanted)}, not {sorted(self.parameters)}")
        series = self.model in SERIES
        numbers = {name: _number(f"{self.model} {name}", value, series) for name, value in self.parameters.items()}
        object.__setattr__(self, "parameters", _Parameters(numbers))
        if series:
            self._check_terms()
        if not 0 <= self.poisson_ratio <= 0.5:  # noqa: PLR2004 -- the incompressible limit
            raise ValueError(f"poisson_ratio must lie in 0..0.5, not {self.poisson_ratio}")
        if self.shear_modulus <= 0:
            raise ValueError(f"the small-strain shear modulus must be positive, not {self.shear_modulus} Pa")

    def number(self, parameter: str) -> float:
        """A parameter that is one number.

        Raises:
            TypeError: If it has several terms.
        """
        value = self.parameters[parameter]
        if isinstance(value, tuple):
            raise TypeError(f"{parameter} of {self.model} has terms")
        return value

    def terms(self, parameter: str) -> tuple[float, ...]:
        """A parameter's numbers, one per term."""
        value = self.parameters[parameter]
        return value if isinstance(value, tuple) else (value,)

    @property
    def shear_modulus(self) -> float:
        """Small-strain shear modulus [Pa]."""
        match self.model:
            case "linear-elastic":
                return self.number("youngs_modulus") / (2 * (1 + self.poisson_ratio))
            case "neo-hookean":
                return self.number("shear_modulus")
            case "mooney-rivlin":
                return 2 * (self.number("c10") + self.number("c01"))
            case "yeoh":
                return 2 * self.number("c1")
            case _:
                return sum(self.terms("mu"))

    @property
    def youngs_modulus(self) -> float:
        """Small-strain Young's modulus, 2 mu (1 + nu) [Pa]."""
        return 2 * self.shear_modulus * (1 + self.poisson_ratio)

    @property
    def bulk_modulus(self) -> float:
        """Small-strain bulk modulus, E / 3 (1 - 2 nu); infinite when incompressible [Pa]."""
        room = 3 * (1 - 2 * self.poisson_ratio)
        return self.youngs_modulus / room if room else math.inf

    @property
    def small_strain_only(self) -> bool:
        """Whether the model is meant for small strain (`linear-elastic`)."""
        return self.model == "linear-elastic"

    def _check_terms(self) -> None:
        counts = {name: len(self.terms(name)) for name in self.parameters}
        if len(set(counts.values())) > 1 or not all(counts.values()):
            listed = ", ".join(f"{count} of {name}" for name, count in counts.items())
            raise ValueError(f"{self.model} takes as many numbers of each parameter, one per term, not {listed}")
        if 0 in self.terms("alpha"):
            raise ValueError(f"{self.model} takes no alpha of 0")


class _Parameters(Mapping[str, Number]):
    """Parameters that nobody can change; unlike a mapping proxy they can be hashed, copied and sent to a process."""

    def __init__(self, numbers: Mapping[str, Number]) -> None:
        self._numbers = dict(numbers)

    def __getitem__(self, name: str) -> Number:
        return self._numbers[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._numbers)

    def __len__(self) -> int:
        return len(self._numbers)

    def __hash__(self) -> int:
        return hash(frozenset(self._numbers.items()))

    def __repr__(self) -> str:
        return repr(self._numbers)


def _number(place: str, value: object, series: bool) -> Number:
    """A finite number, or a tuple of them where the model has terms."""
    if series:
        return tuple(_finite(place, part) for part in (value if isinstance(value, list | tuple) else [value]))
    return _finite(place, value)


def _finite(place: str, value: object) -> float:
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"{place} must be a number, not {value!r}")
    return number
