"""Faults of a serial line damage any message without failing."""

from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from validation.weiss.faults import FAULTS
from validation.weiss.messages import encode_message


@pytest.mark.parametrize("name", FAULTS)
@given(payload=st.binary(max_size=100), random=st.randoms(use_true_random=False))
def test_a_fault_changes_the_message_within_its_bounds(name, payload, random):
    message = encode_message(0x01, payload)
    damaged = FAULTS[name](message, random)
    assert abs(len(damaged) - len(message)) <= max(40, len(message))
    if name not in {"change-bytes", "drop-bytes", "repeat-bytes", "wrong-size"}:  # these may leave it as it was
        assert damaged != message
    if name in {"extra-preamble", "false-head", "boot-text", "repeat"}:
        assert damaged.endswith(message)


def test_the_names_are_those_of_the_command_line():
    assert {"flip-bit", "lose", "cut", "wrong-size"} < set(FAULTS)


@given(
    names=st.lists(st.sampled_from(sorted(FAULTS)), min_size=1, max_size=6),
    message=st.binary(max_size=20),
    random=st.randoms(use_true_random=False),
)
def test_faults_follow_one_another_on_any_bytes(names, message, random):
    """A fault may leave one byte or none; the next fault must accept them."""
    for name in names:
        message = FAULTS[name](message, random)
    assert isinstance(message, bytes)


@pytest.mark.parametrize("name", FAULTS)
@pytest.mark.parametrize("message", [b"", b"\xaa"])
def test_a_fault_accepts_the_shortest_messages(name, message):
    random = Random(0)  # noqa: S311 -- reproducible, no secret
    assert all(isinstance(FAULTS[name](message, random), bytes) for _ in range(20))
