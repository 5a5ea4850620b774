"""The command line on sensors with curved covers."""

import re

import numpy as np
import pytest

from validation.derivation.derive import derive


@pytest.fixture(scope="module")
def derivation(small_pad):
    return derive(small_pad)


@pytest.fixture(scope="module")
def derived(derivation, tmp_path_factory):
    """A folder with the parameters of a curved cover."""
    folder = tmp_path_factory.mktemp("derived")
    derivation.parameters.save(folder)
    return str(folder)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("export", "DERIVED", "--format", "sdf", "--out", "x"), "a model of boxes cannot hold"),
        (("export", "DERIVED", "--format", "urdf", "--out", "x"), "a model of boxes cannot hold"),
        (("export", "DERIVED", "--format", "gazebo", "--out", "x"), "the array must be flat|spread must be a Gaussian"),
        (("press", "DERIVED", "--indenter", "ball:radius=4mm", "--load=1N"), "name the sensor file"),
        (
            ("press", "DERIVED", "--indenter", "ball:radius=4mm", "--load=1N", "--model=fast", "--method=foundation"),
            "does not suit",
        ),
        (
            ("view", "DERIVED", "--indenter", "ball:radius=4mm", "--load=1N", "--method=boxes"),
            "does not suit",
        ),
        (("validate", "DERIVED"), "name the sensor file"),
    ],
    ids=lambda words: " ".join(words) if isinstance(words, tuple) else "",
)
def test_folders_of_curved_covers_are_refused_where_they_have_no_meaning(words, said, derived, softcover, tmp_path):
    status, _, err = softcover(*(derived if word == "DERIVED" else word for word in words))
    assert status == 2
    (line,) = err.splitlines()
    assert re.search(said, line)
    assert list(tmp_path.iterdir()) == []


def test_a_press_of_parameters_does_not_call_force_outside_the_array(derived, softcover):
    status, out, _ = softcover("press", derived, "--indenter", "ball:radius=4mm", "--load=0.2N", "--model=fast")
    assert status == 0
    assert "along the motion" in out


def test_derive_prints_the_responses_and_what_they_mean(derivation, softcover, monkeypatch):
    """Each figure against the derivation itself."""
    monkeypatch.setattr("validation.derivation.derive.derive_cover", lambda *_args, **_options: derivation)
    status, out, _ = softcover("derive", "flat-pad")
    assert status == 0
    text = " ".join(out.translate(str.maketrans("│┌┐└┘├┤┬┴┼─", " " * 11)).split())
    own = np.diag(derivation.responses.matrix)[derivation.sensor.array.active]
    for name, share in (("least", own.min()), ("largest", own.max())):
        assert f"point force that the texel below measures, {name} [%] {100 * share:.1f}" in text
    assert f"hash {derivation.mesh.digest[:12]}: " in text
    assert "of all texels need not sum to the load." in text
    assert "No error of the finite elements is known: there is one mesh only." in text
