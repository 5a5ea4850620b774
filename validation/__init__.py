"""Cases, recordings, scores, reports and the command line; each verb does in Python what a command does.

The verbs are imported when they are first used, so that `import validation` stays cheap.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from validation.api import (
        calibrate,
        datasheet,
        derive,
        export,
        load,
        press,
        read_report,
        record,
        regress,
        replay,
        validate,
    )

__all__ = [
    "calibrate",
    "datasheet",
    "derive",
    "export",
    "load",
    "press",
    "read_report",
    "record",
    "regress",
    "replay",
    "validate",
]


def __getattr__(name: str) -> Any:  # noqa: ANN401 -- functions, and a text
    """Import a verb, or look up `__version__`, when it is used."""
    if name in __all__:
        from validation import api

        return getattr(api, name)
    if name != "__version__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib.metadata import version

    return version("softcover")
