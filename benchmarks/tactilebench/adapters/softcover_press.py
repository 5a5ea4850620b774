"""Press the cases in softcover's fast model, on a cover whose parameters finite elements derive.

    python benchmarks/tactilebench/adapters/softcover_press.py

Needs `pip install -e '.[fem]'`, and ten seconds for each case.  The truth comes from finite elements of the same
project, which share no solver with the fast model.
"""

from __future__ import annotations

import sys

from bodies import FloatArray, make_parser, run

from cases_as_softcover import make_array, make_cover, make_indenter, make_pose
from fastmodel import WTS_0614_34, indent
from tactilebench import Case
from validation.derivation.derive import derive
from validation.sensor_file import SensorDescription


def press(case: Case) -> FloatArray:
    """Return the forces on the texels of a case, shape (n,) [N]."""
    sensor = SensorDescription(
        name=case.name, array=make_array(case), cover=make_cover(case), electronics=WTS_0614_34, source=case.name
    )
    (body,) = case.bodies
    return indent(derive(sensor).parameters, make_indenter(body), load=body.load, pose=make_pose(body)).texel_forces


def main() -> int:
    """Press the cases and score them."""
    return run(make_parser(__doc__).parse_args(), "softcover-fast", "softcover, fast model", press, package="softcover")


if __name__ == "__main__":
    sys.exit(main())
