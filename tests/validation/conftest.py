"""Fixtures that several test modules share."""

import pytest

from validation.cli import main


@pytest.fixture
def softcover(capsys, tmp_path, monkeypatch):
    """Run one command in an empty folder: (exit status, standard output, standard error)."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        with pytest.raises(SystemExit) as left:
            main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        assert "Traceback" not in captured.err
        return left.value.code, captured.out, captured.err

    return run
