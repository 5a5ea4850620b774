"""The interface of a published model of tactile arrays, and the decorator that enters a model in the table."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from meshes import Cover
from validation.published.in_time import Term
from validation.published.scene import Forces

#: Function of a scene and of the parameters of a model by name that returns the forces.
Predict = Callable[..., Forces]
#: Values of the parameters of a model by name, in SI units.
Values = Mapping[str, float]
#: Source of an implementation: code that the authors published.
CODE = "from its published code"
#: Source of an implementation: a summary of code that was not available.
SUMMARY = "from a summary of its code"
#: Source of an implementation: publications that cite the model.
SECONDARY = "paper not read: from equations in secondary sources"
#: Source of an implementation: the report that describes the model.
REPORT = "from the report; unit of the filter's cut-off and handling of borders unknown"
#: Source of an implementation: none, because the model was made for this comparison.
OWN = "our own, for comparison"
#: Input of a model: forces at the contact points of the physics engine.
POINTS = "engine's contact points"
#: Input of a model: depth to which the rigid indenter penetrates the array.
PENETRATION = "rigid penetration"
#: Input of a model: pressure on the contact area.
MAP = "contact map"


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A parameter of a published model of a tactile array.

    Attributes:
        shipped: Published value of the parameter.  None if the value is unknown, or if the parameter is a fitted
            stiffness whose published value is the stiffness of the cover.
        unit: Unit of the parameter; empty for none.
        start: Start value for a fit; None for the published value.
        fitted: Whether the parameter is fitted; a fitted parameter must be positive.
    """

    shipped: float | None = None
    unit: str = ""
    start: float | None = None
    fitted: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class Model:
    """A published model of a tactile array, with its parameters and the source of its equations.

    Attributes:
        name: Short name, unique in the table.
        title: Name of the tool or first author, with the year.
        contact: Input from which the model computes texel forces: `POINTS`, `PENETRATION` or `MAP`.
        rule: Description of the equations in a few words.
        certainty: Source of the implementation, such as `CODE`.
        predict: Function of a scene and of the parameters by name, which returns the forces.
        parameters: The parameters by name.
        total: Sum of the forces in words, if the model itself does not make it equal to the load.
        in_time: Published filters, dampers and noise in words; they have no effect on a held load.
        terms: The terms in time that moving cases use, by their settings as text; empty for none.
    """

    name: str
    title: str
    contact: str
    rule: str
    certainty: str
    predict: Predict
    parameters: Mapping[str, Parameter]
    total: str = ""
    in_time: str = ""
    terms: Mapping[str, Term] = field(default_factory=dict)

    @property
    def units(self) -> dict[str, str]:
        """Units of the parameters that have a unit, by name of the parameter."""
        return {name: each.unit for name, each in self.parameters.items() if each.unit}

    @property
    def fitted(self) -> tuple[str, ...]:
        """Names of the fitted parameters."""
        return tuple(name for name, each in self.parameters.items() if each.fitted)

    @property
    def start(self) -> dict[str, float]:
        """Start values of the fit that differ from the published values, by name of the parameter."""
        return {name: each.start for name, each in self.parameters.items() if each.start is not None}

    def find_shipped(self, cover: Cover) -> Values | None:
        """Return the published values of all parameters; None if a value is unknown or undefined.

        A fitted stiffness without a published value is the stiffness of the cover under a uniform pressure.  This
        stiffness is undefined for a cover of incompressible material.
        """
        values = {name: each.shipped for name, each in self.parameters.items()}
        if "stiffness" in self.fitted and values["stiffness"] is None:
            values["stiffness"] = foundation_stiffness(cover)
        known = {name: value for name, value in values.items() if value is not None}
        return known if len(known) == len(values) else None


def foundation_stiffness(cover: Cover) -> float | None:
    """Compute pressure over depth of a cover that is compressed without lateral strain [Pa/m].

    The layers are springs in series: 1 / sum(h / E_oed), with the oedometric modulus
    E_oed = E (1 - nu) / ((1 + nu) (1 - 2 nu)).  The result is None if all layers are incompressible.
    """
    compliance = 0.0
    for layer in cover.layers:
        e, nu = layer.material.youngs_modulus, layer.material.poisson_ratio
        compliance += layer.thickness * (1 + nu) * (1 - 2 * nu) / (e * (1 - nu))
    return 1 / compliance if compliance > 0 else None


#: The published models by name.  The modules of `validation.published.rules` enter the models on import.
PUBLISHED: dict[str, Model] = {}


def published(
    name: str, *, title: str, contact: str, rule: str, certainty: str, total: str = "", in_time: str = "",
    terms: Mapping[str, Term] | None = None, **parameters: Parameter,
) -> Callable[[Predict], Predict]:  # fmt: skip
    """Return a decorator that enters a prediction function in `PUBLISHED`.

    The arguments are the attributes of `Model`; further keywords are the parameters of the function by name.
    """

    def enter(predict: Predict) -> Predict:
        PUBLISHED[name] = Model(
            name=name, title=title, contact=contact, rule=rule, certainty=certainty, predict=predict,
            parameters=parameters, total=total, in_time=in_time, terms=terms or {},
        )  # fmt: skip
        return predict

    return enter
