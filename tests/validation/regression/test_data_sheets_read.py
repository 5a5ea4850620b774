"""The reading of data sheets: the sensor's own, and a made-up one that states everything."""

from dataclasses import replace

import fastmodel
from validation.regression.exports import measure_data_sheet, measure_exports
from validation.regression.reading import Subject

PARAMETERS = fastmodel.load("wts-0614-34")


def test_numbers_of_the_sensor_and_of_a_made_up_one_are_read_by_their_names():
    own = replace(PARAMETERS, electronics=replace(PARAMETERS.electronics, rate_hz=123.0, noise=0.037))
    found = measure_data_sheet(Subject(parameters=own))
    assert list(found) == ["of the sensor", "of a made-up sensor"]
    mine, made_up = ({value for row in each.numbers.values() for value in row} for each in found.values())
    assert {123.0, 0.037} <= mine
    assert not {123.0, 0.037} & made_up
    # rate, noise, cut-off, pitch, extent, twice 0.4 of 0.3 N of hysteresis, and the temperature coefficient
    assert {100.0, 0.05, 20.0, 3e-3, 4.5e-3, 15e-3, 27e-3, 0.24, -0.01} <= made_up
    assert all((each.tolerance, each.relative, each.unit) == (0.005, True, "SI") for each in found.values())


def test_exported_texts_hold_mass_rate_and_the_sizes_of_two_tilted_texels():
    found = measure_exports(Subject(parameters=PARAMETERS))
    assert list(found) == ["MJCF", "SDF", "URDF", "Gazebo"]
    numbers = {name: [value for row in each.numbers.values() for value in row] for name, each in found.items()}
    for name in ("SDF", "URDF"):
        assert 0.02 in numbers[name]
        assert {2.5e-3, 3.5e-3} <= {round(value, 9) for value in numbers[name]}
    assert 100.0 in numbers["SDF"]
    assert {1.25e-3, 1.75e-3} <= {round(value, 9) for value in numbers["MJCF"]}  # half sizes
    # counts 500 F - 20 - 30 of the threshold leave zero at 0.1 N and reach 1000 at 2.1 N
    assert {6.0, 5.0, 100.0, 500.0, -50.0, 0.1, 2.1, 1000.0, 0.5, 0.35} <= {
        round(each, 9) for each in numbers["Gazebo"]
    }
