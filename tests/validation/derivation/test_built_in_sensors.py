"""The parameters that come with `fastmodel` are those that `derive` finds for the built-in sensors."""

import numpy as np
import pytest

import fastmodel
from validation.derivation.derive import derive
from validation.sensor_file import BUILT_IN

#: Largest difference over the largest entry [-].  Other versions of the linear algebra round differently; a change of
#: the model or of a grid changes the tables by more.
TOLERANCE = 1e-6


def get_tables(parameters):
    """Every array that the fast model reads, by name."""
    cells = parameters.surface
    tables = {"operator": parameters.spread.operator(parameters.array), **parameters.tables}
    cell_tables = {"compliance": cells.compliance, "influence": cells.influence, "top": np.array(cells.top_compliance)}
    return tables | cell_tables


@pytest.mark.slow
@pytest.mark.parametrize("name", BUILT_IN)
def test_parameters_of_built_in_sensors_equal_those_derived_anew(name):
    kept, derived = fastmodel.load(name), derive(BUILT_IN[name]).parameters
    assert kept.electronics == derived.electronics
    assert kept.filter == derived.filter
    np.testing.assert_array_equal(kept.array.centres, derived.array.centres)
    np.testing.assert_array_equal(kept.array.active, derived.array.active)
    old, new = get_tables(kept), get_tables(derived)
    assert old.keys() == new.keys()
    for table, values in new.items():
        np.testing.assert_allclose(old[table], values, rtol=0, atol=TOLERANCE * np.abs(values).max(), err_msg=table)
    assert kept.provenance["depth"]["foundation"]["modulus"] == pytest.approx(
        derived.provenance["depth"]["foundation"]["modulus"], rel=TOLERANCE
    )
