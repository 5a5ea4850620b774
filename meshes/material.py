"""Elastic materials: the name of a material model, and the model's parameters.

The strain energy functions of the models are in `fem_reference`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from meshes.relaxation import Relaxation


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """Parameter of a material model.

    Attributes:
        unit: `Pa` or `-`.
        meaning: Name of the physical quantity, for the documentation of sensor files.
        positive: Whether the parameter must be positive.
    """

    unit: str = "Pa"
    meaning: str
    positive: bool = True


@dataclass(frozen=True, kw_only=True)
class Model:
    """A material model; its strain energy is registered in `fem_reference.materials.ENERGIES`.

    Attributes:
        parameters: Parameters of the model by name.
        shear_modulus: Function that returns the shear modulus at small strain of a material of this model [Pa].
        has_terms: Whether the strain energy is a sum of any number of terms; each parameter then has one number per
            term.
        poisson_ratio: Function that returns the Poisson ratio at small strain of a material of this model, for models
            whose parameters determine it [-]; None if the Poisson ratio is given beside the parameters.
        at_poisson_ratio: Function that returns the parameters of a material with another Poisson ratio, below 0.5, and
            the same response to a change of shape; needed together with `poisson_ratio`.
    """

    parameters: Mapping[str, Parameter]
    shear_modulus: Callable[[Material], float]
    has_terms: bool = False
    poisson_ratio: Callable[[Material], float] | None = None
    at_poisson_ratio: Callable[[Material, float], Mapping[str, Value]] | None = None

    def __post_init__(self) -> None:
        """Check that a model which determines its Poisson ratio can also take another one.

        Raises:
            ValueError: If only one of the two functions is given.
        """
        if (self.poisson_ratio is None) != (self.at_poisson_ratio is None):
            raise ValueError("poisson_ratio and at_poisson_ratio belong together; give both or neither")


#: Value of a material parameter: one number, or one number per term of the strain energy.
Value = float | tuple[float, ...]

#: Material models by name.
MODELS: Mapping[str, Model] = MappingProxyType(
    {
        "linear-elastic": Model(
            parameters={"youngs_modulus": Parameter(meaning="Young's modulus")},
            shear_modulus=lambda each: each.number("youngs_modulus") / (2 * (1 + each.poisson_ratio)),
        ),
        "neo-hookean": Model(
            parameters={"shear_modulus": Parameter(meaning="shear modulus")},
            shear_modulus=lambda each: each.number("shear_modulus"),
        ),
        "mooney-rivlin": Model(
            parameters={
                "c10": Parameter(meaning="modulus of I1 - 3"),
                "c01": Parameter(meaning="modulus of I2 - 3", positive=False),
            },
            shear_modulus=lambda each: 2 * (each.number("c10") + each.number("c01")),
        ),
        "yeoh": Model(
            parameters={
                "c1": Parameter(meaning="modulus of I1 - 3"),
                "c2": Parameter(meaning="modulus of (I1 - 3)^2", positive=False),
                "c3": Parameter(meaning="modulus of (I1 - 3)^3", positive=False),
            },
            shear_modulus=lambda each: 2 * each.number("c1"),
        ),
        "ogden": Model(
            parameters={
                "mu": Parameter(meaning="moduli, one for each term", positive=False),
                "alpha": Parameter(unit="-", meaning="exponents, one for each term", positive=False),
            },
            shear_modulus=lambda each: sum(each.terms("mu")),
            has_terms=True,
        ),
    }
)

#: Largest error of rounding of a Poisson ratio that is computed from parameters [-].
_ROUNDING = 1e-12
#: Largest Poisson ratio of a material whose parameters determine it, so that its bulk modulus stays finite [-].
_NEARLY_INCOMPRESSIBLE = 0.5 - 1e-6


@dataclass(frozen=True, kw_only=True)
class Material:
    """An isotropic elastic material.

    Attributes:
        name: Name in reports.
        model: Name of the material model, a key of `MODELS`.
        parameters: Parameters of the model, in the units of `MODELS`; for a model with terms, one number or a
            sequence of one number per term.  The Ogden strain energy per volume is the sum over the terms of
            2 mu / alpha^2 (l1^alpha + l2^alpha + l3^alpha - 3), with the principal stretches l1, l2, l3.
        poisson_ratio: Poisson ratio at small strain, 0..0.5; may be left out if the parameters determine it [-].
        source: Origin of the parameters, for reports.
        spread: Distance from Young's modulus down to the lower end of its range in the literature, over the modulus:
            0.5 for -50 % [-].
        spread_above: Distance from Young's modulus up to the upper end of its range in the literature, over the
            modulus; None stands for the value of `spread` [-].
        poisson_spread: Half-width of the range of the Poisson ratio in the literature [-].
        relaxation: Relaxation in time, of which the parameters give the start; None for an elastic material.
    """

    name: str
    model: str
    parameters: Mapping[str, Value]
    poisson_ratio: float = math.nan
    source: str = "given by the user"
    spread: float = 0.0
    spread_above: float | None = None
    poisson_spread: float = 0.0
    relaxation: Relaxation | None = None

    def __post_init__(self) -> None:
        """Check the model and its parameters, and store the parameters as floats.

        Raises:
            ValueError: If the model is unknown, a parameter is missing, unknown or not a finite number, the parameters
                have different numbers of terms, the Poisson ratio is out of range, or the shear modulus is not
                positive.
        """
        if self.model not in MODELS:
            raise ValueError(f"unknown material model {self.model!r}; known models: {', '.join(MODELS)}")
        wanted = set(MODELS[self.model].parameters)
        if wanted != set(self.parameters):
            raise ValueError(f"{self.model} takes {sorted(wanted)}, not {sorted(self.parameters)}")
        has_terms = MODELS[self.model].has_terms
        values: dict[str, Value] = {}
        for name, value in self.parameters.items():
            terms = value if isinstance(value, list | tuple) and (has_terms or len(value) == 1) else (value,)
            numbers = tuple(_read_number(f"{self.model} {name}", term) for term in terms)
            values[name] = numbers if has_terms else numbers[0]
        object.__setattr__(self, "parameters", _Parameters(values))
        if has_terms:
            self._check_terms()
        if self.shear_modulus <= 0:
            raise ValueError(f"the small-strain shear modulus must be positive, not {self.shear_modulus} Pa")
        self._check_poisson_ratio()

    def _check_poisson_ratio(self) -> None:
        """Compute the Poisson ratio if the parameters determine it, and check its range.

        Raises:
            ValueError: If the ratio is out of range, or differs from the one that the parameters determine.
        """
        find, name = MODELS[self.model].poisson_ratio, "poisson_ratio"
        if find is not None:
            ratio, name = find(self), f"the Poisson ratio that the parameters of {self.model} determine"
            if math.isclose(ratio, 0, abs_tol=_ROUNDING):
                ratio = 0.0  # The ratio is a difference of two moduli, which may come out slightly negative.
            if not (math.isnan(self.poisson_ratio) or math.isclose(self.poisson_ratio, ratio)):
                raise ValueError(f"the parameters of {self.model} determine poisson_ratio, {ratio:.6g}; leave it out")
            object.__setattr__(self, "poisson_ratio", ratio)
        if not 0 <= self.poisson_ratio <= 0.5:  # noqa: PLR2004 -- the incompressible limit
            raise ValueError(f"{name} must lie in 0..0.5, not {self.poisson_ratio}")

    def with_poisson_ratio(self, ratio: float) -> Material:
        """Return this material with another Poisson ratio; parameters that do not determine the ratio stay as they are.

        A model whose parameters determine the Poisson ratio keeps its response to a change of shape.  It takes ratios
        up to 0.499999; a larger one is reduced to that.
        """
        find = MODELS[self.model].at_poisson_ratio
        if find is None:
            return replace(self, poisson_ratio=ratio)
        return replace(self, parameters=find(self, min(ratio, _NEARLY_INCOMPRESSIBLE)), poisson_ratio=math.nan)

    def number(self, parameter: str) -> float:
        """Return the value of a material parameter that is one number, in the unit that `MODELS` states.

        Raises:
            TypeError: If the parameter has one number per term.
        """
        value = self.parameters[parameter]
        if isinstance(value, tuple):
            raise TypeError(f"{parameter} of {self.model} has terms")
        return value

    def terms(self, parameter: str) -> tuple[float, ...]:
        """Return the numbers of a material parameter, one per term of the strain energy.

        The parameter of a model without terms gives a tuple of one number.
        """
        value = self.parameters[parameter]
        return value if isinstance(value, tuple) else (value,)

    @property
    def shear_modulus(self) -> float:
        """Shear modulus mu at small strain [Pa]."""
        return MODELS[self.model].shear_modulus(self)

    @property
    def youngs_modulus(self) -> float:
        """Young's modulus at small strain, E = 2 mu (1 + nu) [Pa]."""
        return 2 * self.shear_modulus * (1 + self.poisson_ratio)

    @property
    def modulus_range(self) -> tuple[float, float]:
        """Lower and upper end of the range of Young's modulus in the literature, by the two spreads [Pa]."""
        above = self.spread if self.spread_above is None else self.spread_above
        return self.youngs_modulus * (1 - self.spread), self.youngs_modulus * (1 + above)

    @property
    def bulk_modulus(self) -> float:
        """Bulk modulus at small strain, E / (3 (1 - 2 nu)); infinite for an incompressible material [Pa]."""
        divisor = 3 * (1 - 2 * self.poisson_ratio)
        return self.youngs_modulus / divisor if divisor else math.inf

    @property
    def small_strain_only(self) -> bool:
        """Whether the model is valid at small strain only (`linear-elastic`)."""
        return self.model == "linear-elastic"

    def _check_terms(self) -> None:
        """Check that all parameters have the same number of terms, and that no exponent alpha is zero.

        Raises:
            ValueError: If the numbers of terms differ, or an exponent alpha is zero.
        """
        counts = {name: len(self.terms(name)) for name in self.parameters}
        if len(set(counts.values())) > 1 or not all(counts.values()):
            listed = ", ".join(f"{count} of {name}" for name, count in counts.items())
            raise ValueError(f"{self.model} takes as many numbers of each parameter, one per term, not {listed}")
        if 0 in self.terms("alpha"):
            raise ValueError(f"{self.model} takes no alpha of 0")


class _Parameters(Mapping[str, Value]):
    """A read-only mapping of a material's parameters that, unlike `MappingProxyType`, can be hashed and pickled."""

    def __init__(self, values: Mapping[str, Value]) -> None:
        self._values = dict(values)

    def __getitem__(self, name: str) -> Value:
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __hash__(self) -> int:
        return hash(frozenset(self._values.items()))

    def __repr__(self) -> str:
        return repr(self._values)


def _read_number(label: str, value: object) -> float:
    """Convert the value of a parameter to a finite float.

    Args:
        label: Name of the parameter in an error message.
        value: The value as given.

    Raises:
        ValueError: If the value is not a finite number.
    """
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"{label} must be a number, not {value!r}")
    return number
