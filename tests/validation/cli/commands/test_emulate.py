"""`softcover emulate`: which kind of port it takes, and that it lets the port go."""

import importlib
import json
from types import SimpleNamespace

import pytest


@pytest.fixture
def ends(monkeypatch):
    """The ends that were opened, by kind and port, and closed; nothing is served."""
    serve = importlib.import_module("validation.weiss.virtual")
    found = []

    def open_as(kind):
        def open_end(port):
            found.append((kind, port))
            return SimpleNamespace(name=f"{kind} {port}", close=lambda: found.append("closed"))

        return open_end

    monkeypatch.setattr(serve, "SerialEnd", open_as("serial"))
    monkeypatch.setattr(serve, "PseudoTerminal", open_as("link"))
    monkeypatch.setattr(serve, "serve", lambda sensor, _, *, seconds: found.append((sensor.type, seconds)))
    return found


@pytest.mark.parametrize(
    ("port", "kind"),
    [("wts", "link"), ("/dev/ttyS9", "serial"), ("COM3", "serial"), ("socket://h:1", "serial"), ("/tmp/x", "link")],  # noqa: S108 -- not made
)
def test_a_device_or_an_address_is_opened_and_another_name_becomes_a_link(softcover, ends, port, kind):
    status, out, err = softcover("emulate", port, "--seconds", "0", "--json")
    assert (status, err) == (0, "0 frames sent\n")
    assert ends == [(kind, port), ("WTS 0614-34", 0.0), "closed"]
    assert json.loads(out) == {
        "port": f"{kind} {port}", "rate_hz": 271.0, "show": "blob", "type": "WTS 0614-34", "tag": "softcover"
    }  # fmt: skip


def test_without_a_port_there_is_one_of_its_own(softcover, ends):
    assert softcover("emulate", "--seconds", "0")[2].startswith("a sensor of type WTS 0614-34 answers on link None")
    assert ends[0] == ("link", None)


def test_only_links_to_pseudo_terminals_are_replaced(softcover, tmp_path):
    (tmp_path / "mine").symlink_to("file")
    (tmp_path / "left").symlink_to("/dev/pts/999999")
    status, _, err = softcover("emulate", "mine", "--seconds", "0")
    assert (status, "cannot create a link to the port here" in err) == (2, True)
    assert str((tmp_path / "mine").readlink()) == "file"
    assert softcover("emulate", "left", "--seconds", "0")[0] == 0
