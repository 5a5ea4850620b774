"""Codes are verified on the sensor's own cover, with orders that are computed."""

import dataclasses
import math

import numpy as np
import pytest

from meshes import Material
from validation.credibility import verification
from validation.credibility.verification import (
    Check,
    check_bonded_disk,
    check_point_load,
    check_shell,
    check_surface_compliance,
    verify_code,
)


def make_check(errors, sizes=(1.0, 0.5, 0.25), **options):
    values = {"result": errors[-1], "least_order": 1.0, "tolerance": 1e-2} | options
    return Check(name="", exact="", sizes=sizes, errors=errors, **values)


def test_the_order_is_the_slope_of_the_errors():
    assert make_check((0.16, 0.04, 0.01)).order == pytest.approx(2)
    assert make_check((0.09, 0.04, 0.01), sizes=(3, 2, 1)).order == pytest.approx(2)
    assert math.isnan(make_check((0.1, 0.01, 0.0)).order)


def test_a_check_fails_by_its_order_or_by_its_result():
    assert make_check((0.05, 0.02, 0.01)).passed
    assert not make_check((0.04, 0.03, 0.025), result=0.001).passed
    assert not make_check((0.16, 0.08, 0.04)).passed
    assert make_check((0.001, 0.002, 0.001)).passed  # below the tolerance on every grid


@pytest.mark.slow
def test_all_checks_pass_on_the_assumed_cover(wts_derivation):
    sensor = wts_derivation.sensor
    checks = verify_code(sensor.cover, sensor.array)
    assert len(checks) == 7
    assert all(check.passed for check in checks), [check.as_json() for check in checks if not check.passed]
    assert all(1.5 < check.order < 5 for check in checks[:2])
    assert all(0.7 < check.order < 2.5 for check in checks[2:])


def test_a_wrong_compliance_is_noticed(bonded, monkeypatch):
    from fem_reference.linear_response import surface_compliance

    right = surface_compliance.solve_waves
    assert check_surface_compliance(bonded(0.45)).passed

    def off(*arguments, **options):
        found = right(*arguments, **options)
        return dataclasses.replace(found, compliance=1.01 * found.compliance)

    monkeypatch.setattr(surface_compliance, "solve_waves", off)
    check = check_surface_compliance(bonded(0.45))
    assert not check.passed
    assert check.result == pytest.approx(0.01, rel=0.01)


def test_a_wrong_point_spread_is_noticed(wts_derivation, monkeypatch):
    from fem_reference.linear_response import axisymmetric

    spread = wts_derivation.point_spread
    off = dataclasses.replace(spread, pressure_per_force=1.01 * spread.pressure_per_force)
    monkeypatch.setattr(axisymmetric, "point_spread", lambda _: off)
    assert not check_point_load(wts_derivation.sensor.cover).passed


def test_a_wrong_disk_is_noticed(monkeypatch):
    from validation.credibility import verification

    right = verification.compress_disk
    assert check_bonded_disk().passed
    monkeypatch.setattr(verification, "compress_disk", lambda *given: 1.02 * right(*given))
    assert not check_bonded_disk().passed


@pytest.mark.slow
def test_a_cover_under_which_the_closed_form_does_not_exist_has_fewer_checks(bonded, wts):
    stiff = dataclasses.replace(bonded(0.38, youngs_modulus=3e9).layers[0], thickness=1e-4)
    cover = dataclasses.replace(bonded(0.49), layers=(bonded(0.49).layers[0], stiff))
    names = [check.name for check in verify_code(cover, wts)]
    assert 3 <= len(names) < 7
    assert not any("flat cylinder" in name for name in names)
    assert np.unique(names).size == len(names)


def test_a_coarse_shell_is_as_near_to_its_closed_form_at_every_thickness(monkeypatch):
    monkeypatch.setattr(verification, "_SHELL_MESHES", ((1.6, 2),))
    rubber = Material(name="rubber", model="linear-elastic", parameters={"youngs_modulus": 1e6}, poisson_ratio=0.4)
    thin, thick = (check_shell(rubber, thickness).errors for thickness in (0.3e-3, 8e-3))
    assert thin == pytest.approx(thick, rel=1e-6)
    assert 0 < thin[0] < 0.2  # of the load
