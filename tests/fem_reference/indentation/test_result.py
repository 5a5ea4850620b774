"""The error estimate of a result is the sum of the errors of its parts, each computed here by hand."""

from __future__ import annotations

import numpy as np
import pytest

from fem_reference.finite_strain.loading_path import LoadingPath
from fem_reference.indentation.grid_solution import GridSolution, GridStudy
from fem_reference.indentation.layered import _combine_grids
from meshes import Box, Sphere, TexelArray
from meshes.pose import Place, Pose
from tests.support.indentations import FixedBase

SIZES = (4.0, 2.0, 1.0)
SHARES = np.array([0.2, 0.5, 0.1, 0.1])
#: Least relative error of a contact area that a result states [-].
LEAST_AREA_ERROR = 2e-5
PLACE = Place(array=TexelArray.grid(2, 2, pitch=3e-3), pose=Pose())


def make_study(*, force=0.0, depth=0.0, texel=0.0, areas=(1.0, 1.0, 1.0), overlap=0.0, lost=0.0, **options):
    """Solutions that converge with order 2 to force 3 N, depth 0.2 mm, and the shares of the texels.

    Args:
        force: Relative error of the force on the finest grid; likewise `depth` and `texel`, the shares of texels.
        areas: Contact area on each grid.
        overlap: Mean penetration over the depth.
        lost: Share of the force that the base forces lack.
    """
    error = {"error": options.pop("base_error")} if "base_error" in options else {}
    solutions = []
    for size, area in zip(SIZES, areas, strict=True):
        total, shares = 3.0 * (1 + force * size**2), SHARES * (1 + texel * size**2)
        base = total * np.append(shares, 1 - lost - shares.sum())
        solutions.append(
            GridSolution(
                size=size,
                total_force=total,
                depth=2e-4 * (1 + depth * size**2),
                area=area,
                overlap=overlap,
                contact=np.array([[0.0, 0.0, total / 2], [1e-3, 1e-3, total / 2]]),
                base=FixedBase(values=base, **error),
                energy=1e-4,
            )
        )
    return GridStudy(solutions=[solutions], **options)


def estimate(bonded, study, control="depth", indenter=Sphere(radius=5e-3)):  # noqa: B008 -- frozen
    target = 2e-4 if control == "depth" else study.solutions[0][-1].total_force
    path = LoadingPath(cover=bonded(0.45), indenter=indenter, targets=(target,), control=control)
    return _combine_grids(study, 0, path, PLACE, seconds=0.0)


@pytest.mark.parametrize(
    ("parts", "control", "expected"),
    [
        ({"force": 0.01}, "depth", {"total_force": 1.25 * 0.01 / 1.01, "peak_texel": 1.25 * 0.01 / 1.01}),
        ({"depth": 0.02}, "load", {"depth": 1.25 * 0.02 / 1.02}),
        ({"texel": 0.03}, "depth", {"peak_texel": 1.25 * 0.03 / 1.03}),
        ({"overlap": 0.01}, "depth", {"total_force": 0.02, "peak_texel": 0.02}),
        ({"overlap": 0.01}, "load", {"depth": 0.01, "peak_texel": 0.02}),
        ({"least_overlap": 0.01}, "load", {"depth": 0.01, "peak_texel": 0.02}),
        ({"areas": (1.0, 1.04, 1.02)}, "depth", {"contact_area": 2 * 0.04 / 1.02}),
        ({"lost": 0.03}, "depth", {"peak_texel": 0.03}),
        ({"base_error": lambda _place, index, share: 0.1 * share + 0.01 * index}, "load", {"peak_texel": 0.06}),
        (
            {"least_error": 0.004},
            "depth",
            {"total_force": 0.004, "peak_texel": 0.004, "contact_area": 0.004},
        ),
        (
            {"accurate": make_study(force=0.01, accurate=make_study(force=0.02)), "force": 0.04},
            "depth",
            dict.fromkeys(("total_force", "peak_texel"), 1.25 * (0.01 / 1.01 + 0.02 / 1.02 + 0.04 / 1.04)),
        ),
        (
            {"force": 0.01, "texel": 0.001, "overlap": 0.01, "lost": 0.03},
            "load",
            {"peak_texel": 1.25 * (1.01 * 1.001 - 1) / (1.01 * 1.001) + 0.02 + 0.03, "depth": 0.01},
        ),
    ],
    ids=lambda value: "-".join(value) if isinstance(value, dict) else value,
)
def test_each_part_of_an_error_estimate_counts_in_full(bonded, parts, control, expected):
    """Relative errors of the finest grid get the factor 1.25; forces grow at most with the square of the depth."""
    found = estimate(bonded, make_study(**parts), control).error_estimate
    known = {"total_force": 0.0, "depth": 0.0, "peak_texel": 0.0, "contact_area": LEAST_AREA_ERROR} | expected
    assert found == {name: pytest.approx(value, rel=0.01, abs=1e-9) for name, value in known.items()}


@pytest.mark.parametrize(("areas", "expected"), [((1.0, 1.0, 1.0 + 5e-6), 2e-5), ((1.0, 1.0, 1.001), 0.002)])
def test_the_area_of_a_face_that_touches_with_all_of_itself_is_geometry(bonded, areas, expected):
    """Where a face lifts off, its area changes from grid to grid, and errors of the compliance count."""
    study = make_study(areas=areas, least_error=1e-4)
    found = estimate(bonded, study, indenter=Box(size=(4e-3, 3e-3, 5e-3)))
    assert found.error_estimate["contact_area"] == pytest.approx(expected, rel=0.01)
    rounded = estimate(bonded, study)
    assert rounded.error_estimate["contact_area"] == pytest.approx(max(1e-4, expected), rel=0.01)


def test_a_result_scales_contact_forces_to_the_load_and_shows_what_the_base_lacks(bonded):
    study = make_study(lost=0.02)
    found = estimate(bonded, study, "load")
    assert found.balance == pytest.approx(-0.02)
    assert -found.contact_forces[:, 2].sum() == pytest.approx(found.total_force) == pytest.approx(3.0)
    assert found.texel_forces.sum() + found.outside == pytest.approx(0.98 * 3.0)
    assert any("differ from the load by -2.00%" in sentence for sentence in found.warnings)
