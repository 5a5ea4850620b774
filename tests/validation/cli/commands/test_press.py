import json
import re
from types import SimpleNamespace

import numpy as np
import pytest

import fastmodel
from fem_reference.finite_strain.contact_problem import PathSettings
from validation.press_picture import describe_force


def test_both_models_carry_the_load_and_are_scored(softcover):
    place = ("--load", "500g", "--at=-0.7mm,1.1mm", "--yaw=-45deg")
    status, out, _ = softcover("press", "wts-0614-34", "--indenter", "box:size=6mmx10mmx5mm", *place, "--json")
    result = json.loads(out)
    fem, fast = (result["models"][model] for model in ("fem", "fast"))
    assert status == 0
    for entry in (fem, fast):
        assert np.shape(entry["texel_forces"]) == (14, 6)
        assert np.sum(entry["texel_forces"]) + entry["outside"] == pytest.approx(entry["total_force"], rel=1e-3)
        assert entry["total_force"] == pytest.approx(0.5 * 9.80665, rel=1e-3)
    assert fast["method"] == "cover"
    assert fast["depth"] == pytest.approx(fem["depth"], rel=0.1)
    assert fem["error_estimate"].keys() == {"total_force", "depth", "peak_texel", "contact_area"}
    assert fem["assumptions"].keys() >= {"strain", "friction", "base"}
    assert result["scores"].keys() >= {"misplaced_force", "centre_of_pressure_m", "image_changed_percent"}


@pytest.mark.slow
def test_at_a_depth_the_fast_model_takes_the_load_of_the_reference(softcover):
    _, out, _ = softcover("press", "wts-0614-34", "--indenter", "sphere:radius=5mm", "--depth", "0.3mm", "--json")
    models = json.loads(out)["models"]
    assert models["fem"]["depth"] == pytest.approx(0.3e-3, rel=1e-6)
    assert models["fast"]["total_force"] == pytest.approx(models["fem"]["total_force"], rel=1e-3)


def test_the_fast_model_alone_needs_no_finite_elements_also_from_a_derived_folder(softcover, without_reference):
    fastmodel.load("wts-0614-34").save("derived")
    touch = ("--indenter", "sphere:radius=5mm", "--load", "2N", "--model", "fast", "--json")
    built_in, folder = (json.loads(softcover("press", name, *touch)[1]) for name in ("wts-0614-34", "derived"))
    assert folder["models"]["fast"]["texel_forces"] == built_in["models"]["fast"]["texel_forces"]
    assert built_in["cover"]["assumed"] is True
    assert folder["cover"] is None
    assert list(built_in["models"]) == ["fast"]
    assert built_in["scores"] is None


@pytest.mark.slow
def test_a_loading_path_that_stops_is_status_4_in_one_line(softcover, monkeypatch):
    monkeypatch.setattr("fem_reference.finite_strain.contact_problem._SETTINGS", PathSettings(iterations=1))
    press = ("press", "wts-0614-34", "--material", "ecoflex-00-30", "--indenter", "sphere:radius=5mm", "--load", "1N")
    status, _, err = softcover(*press, "--model", "fem")
    assert status == 4
    last = err.splitlines()[-1]
    assert last.startswith("softcover: reached no load of the 1 N asked for: no convergence even at a depth of")
    assert last.endswith("press less, or with a wider or rounder indenter")


PUNCH = ("press", "wts-0614-34", "--indenter", "cylinder:radius=4mm", "--load", "2N", "--model", "fem")


@pytest.mark.slow
def test_an_accuracy_is_reached_or_missed_with_status_1_or_refused(softcover):
    status, _, err = softcover(*PUNCH, "--accuracy", "1%")
    assert (status, "wanted" in err) == (0, False)
    status, out, err = softcover(*PUNCH, "--accuracy", "0.0101%", "--out", "pressed")
    assert status == 1
    assert "softcover: warning: 0.0101 % wanted, but the feasible grids reach" in err
    assert "finite elements" in out
    assert "wrote press.json" in err
    status, _, err = softcover(*PUNCH, "--accuracy", "0.001%")
    assert status == 2
    assert err == "softcover: --accuracy: no grid reaches it: the smallest error that is stated here is 0.01%\n"


def test_an_accuracy_that_no_cells_reach_is_refused_before_a_solution(softcover, monkeypatch):
    monkeypatch.setattr("fem_reference.indentation.layered.LayerPress.solve", None)
    ball = ("--indenter", "sphere:radius=4mm", "--load", "2N", "--friction", "0.5", "--accuracy", "0.5%")
    status, _, err = softcover("press", "wts-0614-34", *ball, "--model", "fem")
    assert (status, "no grid reaches it: the smallest error that is stated here is 0.69%" in err) == (2, True)


def test_one_force_is_printed_once_with_its_parts_and_its_error(softcover):
    status, out, _ = softcover(*PUNCH, "--at=9mm,0mm")
    text = " ".join(out.replace("│", " ").split())
    assert status == 0
    force, texels, outside = map(float, re.search(r"(\S+) N: (\S+) N on the texels, (\S+) N outside", text).groups())
    assert force == 2.0
    assert outside > 0.1
    assert texels + outside == pytest.approx(force, abs=1.1e-4)
    assert "total force" not in text  # the load is given
    _, out, _ = softcover(*PUNCH[:4], "--depth", "0.1mm", "--model", "fem")
    assert "error estimate total force" in " ".join(out.replace("│", " ").split())


def test_an_imbalance_is_a_part_of_the_printed_force():
    found = SimpleNamespace(total_force=2.0, texel_forces=np.array([1.5, 0.3864]), outside=0.1, mesh=None, force=None)
    assert describe_force(found) == (
        "2.0000 N: 1.8864 N on the texels, 0.1000 N outside the array, +0.0136 N not balanced"
    )
