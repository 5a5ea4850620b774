"""Opening a port, and the buffer between port and consumer."""

import os

import pytest

from tests.support.virtual_port import is_ramp, wait_until
from validation.weiss.continuity import Gap
from validation.weiss.link import Link, LinkLostError, PortError
from validation.weiss.protocol import Reading
from validation.weiss.sensor import Sensor


def test_a_slow_consumer_loses_frames_and_sees_the_gap(plug_in):
    with Sensor(plug_in().name, buffer_bytes=4000) as sensor:
        stream = sensor.stream()
        next(stream)
        wait_until(lambda: sensor._link._lost > 2000)
        events = [next(stream) for _ in range(160)]  # gaps are known once the period of the device is
        stream.close()
    assert {"overflow", "frames missing"} <= {event.kind for event in events if isinstance(event, Gap)}
    assert all(is_ramp(event.counts) for event in events if isinstance(event, Reading))


def test_bytes_received_before_the_port_went_away_are_fetched_first(plug_in):
    port = plug_in()
    link = Link(port.name)
    link.write(bytes.fromhex("AAAAAA210300000000F55C"))
    wait_until(lambda: link._buffered > 1000)
    port.unplug()
    wait_until(lambda: link._failure is not None)
    assert sum(len(chunk.data) for chunk in link.read(0.0)) > 1000
    with pytest.raises(LinkLostError, match="unplugged"):
        link.read(0.0)
    link.close()


def test_a_second_client_is_refused(plug_in):
    port = plug_in()
    with Sensor(port.name), pytest.raises(PortError, match=r"another program has it open.*one client"):
        Sensor(port.name)


def test_a_name_that_is_no_port_is_refused_in_one_line(tmp_path):
    with pytest.raises(PortError, match="no such port; ports on this machine"):
        Sensor("/dev/ttyNONE9")
    plain = tmp_path / "file"
    plain.write_text("hello")
    with pytest.raises(PortError, match="not a serial port"):
        Sensor(str(plain))
    with pytest.raises(PortError, match="cannot be opened"):
        Sensor("nonsense://x")
    for name in (str(plain), "/dev/ttyNONE9", "nonsense://x"):
        with pytest.raises(PortError) as caught:
            Sensor(name)
        assert "\n" not in str(caught.value)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="changes the user, which needs root")
def test_permission_denied_names_the_group(plug_in):
    grp = pytest.importorskip("grp")
    port = plug_in().name
    os.chmod(port, 0o600)  # noqa: PTH101 -- a device
    group = grp.getgrgid(os.stat(port).st_gid).gr_name  # noqa: PTH116 -- a device
    os.seteuid(65534)
    try:
        with pytest.raises(PortError, match=f"no permission to open it.*usermod -aG {group}"):
            Sensor(port)
    finally:
        os.seteuid(0)
