"""Clients in the style of public ones get frames from the emulated sensor; they share no code with it."""

import numpy as np
import pytest

pytest.importorskip("pty", reason="pseudo-terminals need Linux or macOS")

from tests.support.wts_clients import MessageClient, PollingClient, stream_run_length, wait_for_tag
from validation.weiss.protocol import MatrixInfo
from validation.weiss.virtual import show_pattern

MATRIX = MatrixInfo(columns=6, rows=13, cell_width=3.4e-3, cell_height=3.4e-3, full_scale=4095)


def test_a_client_that_polls_with_a_short_time_out_gets_frames(plug_in):
    client = PollingClient(plug_in(show_pattern("corner")).name)
    whole, polls = [], 0
    while len(whole) < 40 and polls < 2000:  # the time-out is 50 ms, which a busy machine may miss
        frame, polls = client.read(), polls + 1
        whole += [] if frame is None else [frame]
    client.close()
    assert len(whole) == 40
    assert all(frame[0] == 2000 and not any(frame[1:]) for frame in whole)


@pytest.mark.parametrize("options", [{}, {"tag": "left hand"}])
def test_a_client_that_waits_for_a_tag_gets_one_and_then_frames(plug_in, options):
    client = MessageClient(plug_in(show_pattern("ramp", MATRIX), matrix=MATRIX, **options).name)
    tag, shape, pitch, full_scale = wait_for_tag(client)
    assert (tag, shape, pitch, full_scale) == (options.get("tag", "softcover"), (6, 13), (340, 340), 4095)
    client.ask(0x21, bytes(3))
    assert len(client.receive(0x00)) == 5 + 2 * 78
    client.close()


@pytest.mark.parametrize(
    "pattern", [pytest.param("zero", marks=pytest.mark.slow), pytest.param("corner", marks=pytest.mark.slow), "ramp"]
)
def test_a_client_that_streams_run_length_frames_decodes_them(plug_in, pattern):
    client = MessageClient(plug_in(show_pattern(pattern)).name)
    found = stream_run_length(client, 60)
    client.close()
    ticks = np.array([tick for tick, _ in found])
    assert set(np.diff(ticks)) <= {3, 4}
    for _, counts in found:
        assert len(counts) == 84
        expected = {"zero": np.zeros(84), "corner": 2000 * (np.arange(84) == 0)}.get(pattern)
        assert np.array_equal(counts, expected) if expected is not None else set(np.diff(counts) % 4096) == {40}
