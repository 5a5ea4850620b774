"""An evaluation of two cases whose numbers are made up, for tests of the page that shows them.

No contact is solved.  All numbers differ, so that a number in a wrong place is noticed.  The images of the cases have
three loaded texels each.
"""

import dataclasses
from types import SimpleNamespace

import numpy as np

from validation.campaign.campaign_file import read_campaign
from validation.campaign.case import Case
from validation.campaign.evaluation import Evaluation, versions
from validation.campaign.results import MODELS, SKILL_METRICS, CaseResult, Prediction, Reference, RowScores
from validation.campaign.run import summarise
from validation.credibility.evidence import GROUP_METRICS, Evidence
from validation.credibility.stages import STAGES, StageErrors
from validation.credibility.uncertainty import ComparisonError, InputUncertainty
from validation.credibility.verification import Check, Convergence
from validation.metrics import METRICS, TABULATED, Score
from validation.places import FlatPlaces
from validation.pooling import Pooled, pool
from validation.verdict import judge

CASES = (
    Case.read("sphere", "sphere:radius=5mm", "500 g", at="1.7mm,1.7mm"),
    Case.read("box", "box:size=6mmx10mmx5mm", "100 g", at="0.7mm,-1.1mm", yaw="45deg"),
)
#: Forces on the texels 15, 16 and 21 of the reference and of the fast model in each case [N].
LOADED = (15, 16, 21)
REFERENCE = {"sphere": (2.1, 1.3, 0.8), "box": (0.5, 0.2, 0.125)}
FAST = {"sphere": (1.9, 1.45, 0.9), "box": (0.56, 0.21, 0.1)}
#: Corners of the contact in each case, in the array's frame [m], and a point within it.
CONTACT = ((-1e-3, -2e-3), (3e-3, -2e-3), (3e-3, 4e-3), (-1e-3, 4e-3), (1e-3, 1e-3))
CHECKS = (
    Check(name="waves", exact="transfer matrices", sizes=(1.0, 0.5, 0.25), errors=(0.08, 0.02, 0.005), result=0.0031,
          least_order=1.5, tolerance=0.004),
    Check(name="disk", exact="a series", sizes=(1.0, 0.5, 0.25), errors=(0.09, 0.06, 0.04), result=0.025,
          least_order=0.7, tolerance=0.02),
)  # fmt: skip
CONVERGENCE = (
    Convergence(case="sphere", quantity="depth", unit="\u00b5m", factor=1e6, values=(3.1e-4, 3.21e-4, 3.234e-4),
                result=3.2451e-4, order=2.13, estimate=0.0062),
    Convergence(case="box", quantity="peak texel", unit="mN", factor=1e3, values=(0.49, 0.4951, 0.50123),
                result=float("nan"), order=float("nan"), estimate=0.0171),
)  # fmt: skip
#: E = -0.2 N, below u_val = 0.65 N and above u_num; E = 0.1 mm, above u_val = 0.05 mm; E of an unknown u_val.
ERRORS = (
    ComparisonError(case="sphere", quantity="largest texel force [mN]", factor=1e3, fast=1.9, reference=2.1,
                    u_num=0.15, u_input=0.2, u_data=0.6),
    ComparisonError(case="box", quantity="centre x [mm]", factor=1e3, fast=0.8e-3, reference=0.7e-3,
                    u_num=0.03e-3, u_input=0.04e-3, u_data=0.0),
    ComparisonError(case="box", quantity="sum [N]", factor=1.0, fast=0.87, reference=0.825, u_num=0.06,
                    u_input=float("nan"), u_data=0.0),
)  # fmt: skip
UNCERTAINTIES = {
    "modulus [relative]": 0.123, "Poisson ratio [-]": 0.0045, "position x [m]": 1.5e-4, "yaw [rad]": 0.0349,
    "friction": 0.75,
}  # fmt: skip


def give_forces(values, count=84):
    """Forces on all texels, shape (n,): three are loaded, the others are zero."""
    out = np.zeros(count)
    out[list(LOADED)] = values
    return out


def make_score(first):
    """A score whose metrics all differ: 0.1 % of the first number, 0.2 %, ..."""
    return Score(
        **{
            name: round(10 * first) + k if name.startswith("pixels") else first * (1 + 0.1 * k)
            for k, name in enumerate(METRICS)
        }
    )


def make_pooled(mean, cases=6):
    return Pooled(mean=mean, low=0.9 * mean, high=1.3 * mean, level=0.95, cases=cases)


def make_case(number, case):
    """Result of one case; the models have different scores."""
    corners = np.array(CONTACT)
    points = np.column_stack([corners, np.zeros(len(corners))])
    found = SimpleNamespace(contact_points=points, contact_forces=np.tile([0.0, 0.0, -1.0], (len(points), 1)))
    reference = Reference(
        texel_forces=give_forces(REFERENCE[case.name]), outside=0.01, total_force=case.load,
        depth=(3.2e-4, 0.9e-4)[number], contact_area=(21e-6, 60e-6)[number],
        error_estimate={"total_force": 0.001, "depth": 0.002, "peak_texel": (0.003, 0.007)[number],
                        "contact_area": 0.004},
        assumptions={"friction": "none", "strain": "small"}, warnings=(), found=found,
    )  # fmt: skip
    forces = {name: give_forces(REFERENCE[case.name]) for name in MODELS} | {"fast": give_forces(FAST[case.name])}
    predictions = {
        name: Prediction(texel_forces=forces[name], outside=0.0, score=make_score(0.01 * (k + 1) + 0.03 * number))
        for k, name in enumerate(MODELS)
    }
    return CaseResult(case=case, reference=reference, warnings=(), predictions=predictions)


def make_row(name, skills, **options):
    """A published model: its pooled scores, and the interval of the fast model's skill by each metric."""
    about = {
        "title": name.capitalize(), "variant": "as fitted", "contact": "points", "rule": "a cone", "certainty": "code",
        "total": "the load", "not_built": "", "parameters": {"cone_angle": 0.5236, "stiffness": 1.2e9},
        "units": {"cone_angle": "rad", "stiffness": "Pa/m"}, "fitted": ("cone_angle", "stiffness"),
        "fitted_on": ("a ball, 3 N", "a punch, 2 N"), "fit_misplaced_force": 0.2,
    }  # fmt: skip
    pooled = {metric: make_pooled((0.05 + 0.01 * k) * len(name)) for k, metric in enumerate(TABULATED)}
    skill = {
        metric: Pooled(mean=(low + high) / 2, low=low, high=high, level=0.95, cases=cases)
        for metric, (low, high, cases) in zip(SKILL_METRICS, skills, strict=True)
    }
    return RowScores(name=name, pooled=pooled, skill=skill, **(about | options))


#: Rows that are behind by all metrics, as good or better by some, and of too few cases to tell.
PUBLISHED = (
    make_row("cone", ((0.1, 0.3, 6), (0.2, 0.4, 6), (0.3, 0.5, 6))),
    make_row("grid", ((-0.3, -0.1, 6), (-0.1, 0.2, 6), (0.1, 0.2, 6)), fitted=(), fitted_on=(), variant="as shipped",
             total="a half of the load", not_built="creep", parameters={}),
    make_row("wave", ((0.1, 0.2, 4), (-0.2, -0.1, 4), (0.1, 0.2, 5))),
)  # fmt: skip


def make_evidence(sensor):
    effects = {name: give_forces((0.01 * (k + 1), -0.004, 0.0)) for k, name in enumerate(UNCERTAINTIES)}
    inputs = {
        case.name: InputUncertainty(
            load=case.load, uncertainties=UNCERTAINTIES, image=give_forces(REFERENCE[case.name]), note="a note",
            effects={name: (1 + number) * effect for name, effect in effects.items()},
        )
        for number, case in enumerate(CASES)
    }  # fmt: skip
    shares = {
        "sphere": dict(zip(STAGES, (0.001, 0.021, 0.013, 0.04), strict=True)),
        "box": dict(zip(STAGES, (0.003, 0.017, 0.019, 0.06), strict=True)),
    }
    stages = StageErrors(cases=shares, pooled={name: pool([each[name] for each in shares.values()]) for name in STAGES})
    members = {"load": ("2 N and more", "below 2 N"), "pose": ("turned",)}
    groups = {
        group: {
            member: {name: make_pooled(0.01 * (k + 1) + 0.1 * n + 0.05 * len(group), 3 + n)
                     for k, name in enumerate(GROUP_METRICS)}
            for n, member in enumerate(names)
        }
        for group, names in members.items()
    }  # fmt: skip
    return Evidence(
        checks=CHECKS, convergence=CONVERGENCE, inputs=inputs, errors=ERRORS, stages=stages, groups=groups,
        domain={"load_N": (0.981, 4.9), "depth_over_thickness": (0.045, 0.16), "contact_area_m2": (21e-6, 60e-6),
                "obliquity_rad": (0.0, 0.5236), "share_outside_array": (0.0, 0.12)},
        failed=("a check did not converge",), left_out=("one section has no meaning",),
        notes={"campaign": "A note on the campaign."},
    )  # fmt: skip


def make_evaluation(derivation):
    """An evaluation of a derived sensor of 84 texels, whose other numbers are made up."""
    sensor = derivation.sensor
    campaign = dataclasses.replace(
        summarise([make_case(number, case) for number, case in enumerate(CASES)], (), None), published=PUBLISHED
    )
    plan = dataclasses.replace(read_campaign(None, FlatPlaces(array=sensor.array)), cases=CASES)
    return Evaluation(
        derivation=derivation, verification={"radial_profile": 0.00123, "texel_response": 0.00234}, plan=plan,
        campaign=campaign, verdict=judge(plan, campaign), evidence=make_evidence(sensor), recordings=None,
        recorded=sensor, seconds={"derive": 4.5, "campaign": 31.25}, versions=versions(),
    )  # fmt: skip
