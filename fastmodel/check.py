"""Warnings about options of a model or of a sensor that reduce accuracy."""

from __future__ import annotations

import warnings

import mujoco

from fastmodel.parameters import Parameters

#: Tolerance for comparisons of rates; it allows for rounding [-].
_RATE_TOLERANCE = 1e-3


class OptionWarning(UserWarning):
    """Warn of options of the model or of the sensor that reduce accuracy; the options stay as they are."""


def list_options(model: mujoco.MjModel) -> tuple[float, ...]:
    """List the options of a model that a sensor depends on or warns of, to notice later that one has changed.

    Args:
        model: The compiled model.
    """
    option = model.opt
    numbers = (option.timestep, option.cone, option.solver, option.impratio, option.noslip_iterations)
    return (*numbers, option.iterations, option.disableflags, option.enableflags)


def warn_of_options(parameters: Parameters, model: mujoco.MjModel, every: int) -> None:
    """Warn of options of the model or of the sensor that reduce accuracy.

    Args:
        parameters: The array and its cover.
        model: The compiled model with the sensor.
        every: Number of physics steps between two samples of the contact forces [-].
    """
    rate = parameters.electronics.rate_hz
    sampled = 1.0 / (every * model.opt.timestep)
    messages = []
    if model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL or model.opt.solver != mujoco.mjtSolver.mjSOL_NEWTON:
        messages.append(
            "forces of sliding contacts are unsteady without Newton and elliptic cones; "
            "fastmodel.recommend_options(spec) sets them"
        )
    if parameters.filter is not None and parameters.filter.cutoff_hz > rate / 2:
        messages.append(f"cutoff_hz {parameters.filter.cutoff_hz:g} exceeds half the frame rate of {rate:g} Hz")
    if rate > sampled * (1 + _RATE_TOLERANCE):
        messages.append(f"frames come at {sampled:g} Hz, not {rate:g} Hz: contact forces are sampled no more often")
    for message in messages:
        warnings.warn(message, OptionWarning, stacklevel=3)
