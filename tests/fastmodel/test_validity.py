"""The range of the fast model: when a contact lies beyond it, and what the warning says."""

import dataclasses
import math
import re
import warnings

import mujoco
import numpy as np
import pytest

import fastmodel
from fastmodel import RangeWarning
from fastmodel.contact.boxes import BoxReader
from fastmodel.contact.interface import Reading
from fastmodel.errors import ParametersError
from fastmodel.validity import Validity, describe_end, describe_limits, describe_offset, find_offset, goes_on
from meshes import Box, Sphere, TexelArray
from tests.support.scenes import make_spec, run, simulate

PARAMETERS = fastmodel.load("wts-0614-34")
RANGE = Validity(
    ball_radius=3e-3,
    load_2_percent=0.5,
    load_5_percent=1.0,
    depth_2_percent=0.1e-3,
    depth_5_percent=0.2e-3,
    largest_load=2.0,
    strain="finite",
)


def reading(**changes) -> Reading:
    return Reading(np.ones(4), np.ones(4), 4.0, np.array([0.15e-3]), 20)._replace(**changes)


@pytest.mark.parametrize(
    ("changes", "beyond"),
    [
        ({}, False),
        ({"approach": np.array([0.15e-3, 0.21e-3])}, True),
        ({"approach": None}, True),
        ({"approach": None, "carried": 0.9}, False),
        ({"approach": None, "carried": 1.0}, False),
        ({"approach": np.array([0.2e-3])}, False),
        ({"approach": np.array([])}, False),
        ({"approach": np.array([0.3e-3]), "texel_forces": None}, False),
    ],
)
def test_a_contact_is_judged_by_its_depth_and_without_one_by_its_force(changes, beyond):
    assert RANGE.is_exceeded(reading(**changes)) == beyond
    assert len(describe_limits(reading(**changes), RANGE)) == beyond


def test_the_warning_states_the_contact_and_the_limit():
    text = RANGE.describe_excess(reading(approach=np.array([0.3e-3])))
    assert "4 N, 0.3 mm deep" in text
    assert "above 1 N, 0.2 mm deep" in text
    assert "more than 5 %" in text
    assert "unknown" in dataclasses.replace(RANGE, load_5_percent=2.0).describe_excess(reading())
    assert "only 8 of" in describe_limits(reading(fewest_cells=8), None)[0]
    assert describe_limits(reading(fewest_cells=9), None) == ()


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("ball_radius", 0.0, "ball_radius must be positive"),
        ("ball_radius", "3 mm", "ball_radius must be a finite number"),
        ("load_2_percent", -0.1, "load_2_percent must be a finite number"),
        ("load_5_percent", math.nan, "load_5_percent must be a finite number"),
        ("depth_5_percent", True, "depth_5_percent must be a finite number"),
        ("largest_load", math.inf, "largest_load must be a finite number"),
        ("largest_load", 0.9, "must not descend"),
        ("load_2_percent", 1.1, "must not descend"),
        ("depth_2_percent", 0.3e-3, "must not exceed depth_5_percent"),
        ("strain", "large", "strain must be finite or small, not 'large'"),
    ],
)
def test_a_range_of_bad_values_is_refused_also_in_a_file(tmp_path, name, value, message):
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(RANGE, **{name: value})
    dataclasses.replace(PARAMETERS, validity=RANGE).save(tmp_path / "sensor")
    path = tmp_path / "sensor" / "parameters.toml"
    text = f'"{value}"' if isinstance(value, str) else str(value).lower()
    head, section = path.read_text().split("[validity]")
    path.write_text(head + "[validity]" + re.sub(rf"(?m)^{name} = .*$", f"{name} = {text}", section))
    with pytest.raises(ParametersError, match=rf"parameters.toml: \[validity\] .*{message}"):
        fastmodel.load(tmp_path / "sensor")


@pytest.mark.parametrize(
    "changes",
    [
        {"load_2_percent": 0.0, "depth_2_percent": 0.0}, {"load_2_percent": 1.0, "load_5_percent": 1.0},
        {"depth_2_percent": 0.2e-3}, {"load_5_percent": 2, "largest_load": 2}, {"strain": "small"},
    ],
)  # fmt: skip
def test_a_range_may_start_at_zero_and_its_limits_may_be_equal(changes):
    assert dataclasses.replace(RANGE, **changes)


@pytest.mark.parametrize("name", ["ball_radius", "largest_load"])
def test_a_radius_or_largest_load_of_zero_is_refused(name):
    with pytest.raises(ValueError, match=f"{name} must be positive, not 0"):
        dataclasses.replace(RANGE, load_2_percent=0.0, load_5_percent=0.0, **{name: 0.0})


@pytest.mark.parametrize(("share", "told"), [(0.9e-3, False), (1e-3, False), (1.1e-3, True)])
def test_a_thousandth_of_the_force_on_the_outermost_cells_reaches_the_end_of_a_plate(share, told):
    contact = reading(at_end=share)
    assert goes_on(share) == told
    assert describe_limits(contact, None) == (describe_end(share),) * told


def test_all_that_is_known_to_be_wrong_is_told_at_once():
    contact = reading(at_end=0.2, fewest_cells=3, approach=np.array([0.3e-3]))
    few, end, excess = describe_limits(contact, RANGE)
    assert "covers only 3 of" in few
    assert "bear 0.2 of the force" in end
    assert excess == RANGE.describe_excess(contact)
    assert describe_limits(reading(fewest_cells=None), RANGE) == ()


def test_the_offset_of_the_centre_is_the_missing_torque_over_the_force():
    torques = np.array([9.0, 9.0, 9.0, 0.6, 0.0, -0.8])
    assert find_offset(reading(torques=torques)) == pytest.approx(1.0 / 4.0)
    assert "lies 2.5e+02 mm from" in describe_offset(reading(torques=torques))
    for contact in (reading(), reading(torques=torques, carried=0.0), reading(torques=torques, carried=-1.0)):
        assert find_offset(contact) == 0


@pytest.mark.parametrize(("margin", "warned"), [(None, 1), ((3e-3, 3e-3), 0)])
def test_a_running_sensor_warns_once_of_a_contact_that_may_go_on_beyond_the_plate(margin, warned):
    array = dataclasses.replace(PARAMETERS.array, margin=margin)
    spec = make_spec(timestep=2e-3)
    sensor = fastmodel.attach(spec, "world", dataclasses.replace(PARAMETERS, array=array, validity=None), every=1)
    fastmodel.add_indenter(spec, Box(size=(0.1, 0.1, 0.01)), 8.0)
    model, data = simulate(spec, sensor, 0)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        run(sensor, model, data, 100)
    assert [each.category for each in caught] == [RangeWarning] * warned
    assert all("reaches the end of the plate" in str(each.message) for each in caught)


def test_a_running_sensor_warns_once():
    spec = make_spec(timestep=2e-3)
    sensor = fastmodel.attach(spec, "world", dataclasses.replace(PARAMETERS, validity=RANGE), every=1)
    fastmodel.add_indenter(spec, Sphere(radius=2e-3), 8.0)
    model, data = simulate(spec, sensor, 0)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for _ in range(100):
            mujoco.mj_step(model, data)
            sensor.step(data)
    assert [each.category for each in caught] == [RangeWarning]
    assert "sensor" in str(caught[0].message)
    assert caught[0].filename == __file__


def test_the_range_survives_saving_and_is_optional(tmp_path):
    for validity in (RANGE, None):
        dataclasses.replace(PARAMETERS, validity=validity).save(tmp_path)
        assert fastmodel.load(tmp_path).validity == validity
    text = (tmp_path / "parameters.toml").read_text()
    assert 'validity = "not stated"' in text
    (tmp_path / "parameters.toml").write_text(text.replace('validity = "not stated"\n', ""))
    assert fastmodel.load(tmp_path).validity is None


class TurnedReader(BoxReader):
    """Boxes whose pressure has a torque of its own, and lacks the force times an arm of MuJoCo's torque."""

    arm = 0.0

    def at_rest(self, forces):
        return super().at_rest(forces)._replace(torques=np.zeros(6))

    def read(self, data):
        found = super().read(data)
        missed = found.carried * self.arm * np.array([0.6, -0.8, 0.0])
        return found._replace(torques=np.concatenate([found.carried * np.array([1e-3, 2e-3, 3e-3]), missed]))


@dataclasses.dataclass(frozen=True, kw_only=True)
class Turned(fastmodel.BoxTexels):
    arm: float = 0.0

    def bind(self, model, array, name, *, surface=None):
        reader = TurnedReader(model, array, name)
        reader.arm = self.arm
        return reader


@pytest.mark.parametrize(("arm", "warned"), [(0.99e-3, 0), (1.01e-3, 1)])
@pytest.mark.parametrize("pitch", [(2e-3, 3e-3), (3e-3, 2e-3)])
def test_a_centre_of_pressure_off_by_half_of_the_smaller_pitch_is_warned_of_once(pitch, arm, warned):
    array = TexelArray.grid(3, 3, pitch)
    parameters = dataclasses.replace(PARAMETERS, array=array, surface=None, validity=None, tables={})
    spec = make_spec(timestep=2e-3)
    sensor = fastmodel.attach(spec, "world", parameters, contact=Turned(arm=arm), every=1)
    fastmodel.add_indenter(spec, Sphere(radius=4e-3), 2.0)
    model, data = simulate(spec, sensor, 0)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        run(sensor, model, data, 60)
    assert [each.category for each in caught] == [RangeWarning] * warned
    assert all(re.search("sensor 'sensor': .*centre of pressure lies 1 mm from", str(each.message)) for each in caught)
    frame, load = sensor.frame(), sensor.carried()
    assert load == pytest.approx(2.0, rel=1e-2)
    np.testing.assert_allclose(frame.pressure_torque, load * np.array([1e-3, 2e-3, 3e-3]))
    np.testing.assert_allclose(frame.missed_torque, load * arm * np.array([0.6, -0.8, 0.0]))
    assert frame.net_force[2] == pytest.approx(-load)
    assert np.abs(frame.net_torque).max() < 1e-3 * load
    assert frame.tangential.shape == (9, 2)
