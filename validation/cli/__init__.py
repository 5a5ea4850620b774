"""The command line: `softcover COMMAND`.

Each command is one module, loaded when it is called; `main` turns what went wrong into one readable line per
fault and an exit status: 0 done, 1 a gate or check failed, 2 bad input, 3 something outside failed, 4 a solver
did not converge.
"""

from __future__ import annotations

from validation.cli.entry import app, main

__all__ = ["app", "main"]
