"""Unpacking a bzip2 file in pieces."""

import bz2
from unittest.mock import patch

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from validation.recordings import RecordingError, dsa

_REPEATED = st.builds(lambda data, times: data * times, st.binary(max_size=9), st.integers(0, 9))
CONTENTS = st.binary(max_size=300) | _REPEATED
_SHARED_FOLDER = settings(suppress_health_check=[HealthCheck.function_scoped_fixture])


@_SHARED_FOLDER
@given(content=CONTENTS, size=st.integers(1, 40))
def test_the_pieces_are_the_content(tmp_path, content, size):
    path = tmp_path / "a.dsa"
    path.write_bytes(bz2.compress(content))
    with patch.object(dsa, "LIMITS", dsa.Limits(piece_bytes=size)):
        pieces = list(dsa.unpack_bzip2(path, limit=len(content)))
    assert b"".join(pieces) == content
    assert all(0 < len(piece) <= size for piece in pieces)


@_SHARED_FOLDER
@given(content=CONTENTS, data=st.data())
def test_a_shorter_or_longer_file_is_refused(tmp_path, content, data):
    path, packed = tmp_path / "a.dsa", bz2.compress(content)
    changed = packed[: data.draw(st.integers(0, len(packed) - 1))]
    if data.draw(st.booleans()):
        changed = packed + data.draw(st.binary(min_size=1, max_size=10))
    path.write_bytes(changed)
    with pytest.raises(RecordingError, match=r"a\.dsa: (truncated|bytes follow|damaged)"):
        list(dsa.unpack_bzip2(path, limit=10_000))


def test_a_file_that_unpacks_to_more_than_the_limit_is_refused_early(tmp_path):
    path = tmp_path / "a.dsa"
    path.write_bytes(bz2.compress(bytes(2**24)))
    pieces = []
    with pytest.raises(RecordingError, match="more than the 100000 bytes accepted"):
        pieces.extend(dsa.unpack_bzip2(path, limit=100_000))
    assert 0 < sum(len(piece) for piece in pieces) <= 100_000
