import numpy as np

from validation.cli.live_image import LiveImage


def test_without_a_terminal_a_line_is_written_at_most_every_few_seconds(capsys):
    with LiveImage(columns=6, full_scale=4095) as live:
        shown = 0
        for _ in range(100):
            if live.is_due:
                live.show(np.zeros(84, dtype=int), "0.1 s")
                shown += 1
    assert shown == 1
    assert capsys.readouterr().err == "0.1 s\n"


def test_a_quiet_image_is_never_due():
    with LiveImage(columns=6, full_scale=4095, quiet=True) as live:
        assert not live.is_due
