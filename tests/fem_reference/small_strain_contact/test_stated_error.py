"""The error that the exact contact of a layer states, against the error of its kernel, computed anew."""

import numpy as np
import pytest
from scipy.integrate import quad

from fem_reference.closed_form.contact import punch
from fem_reference.closed_form.layer import half_space_compliance, transfer
from tests.support.rubber import stack_layers


@pytest.mark.parametrize(("ratio", "width"), [(0.5, 30), (0.499, 20)])
def test_the_error_of_a_punch_is_that_of_its_kernel(ratio, width):
    """(2 / pi) 3e-15 m(0) int phi dt for a unit depth, which a wide contact on incompressible rubber enlarges.

    m(0) is the integral of the relative compliance less one; the force gives the integral of phi.
    """
    thickness, modulus = 1e-3, 1e6
    cover = stack_layers((thickness, modulus, ratio))
    found = punch(cover, width * thickness, 1e-5)

    def relative(k):
        k = np.array([k])
        return float((transfer(cover, k).compliance / half_space_compliance(cover.layers[-1], k) - 1)[0])

    kernel, _ = quad(relative, 1e-9, 25 / thickness, limit=500, points=[1 / thickness, 5 / thickness])
    scale = 2 / np.pi * modulus / (2 * (1 + ratio)) / (1 - ratio)
    flat = found.force / (2 * np.pi * 1e-5 * scale)
    assert found.error == pytest.approx(2 / np.pi * 3e-15 * abs(kernel) * flat, rel=0.05)
