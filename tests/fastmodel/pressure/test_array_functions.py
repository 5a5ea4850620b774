import dataclasses
import re

import numpy as np
import pytest

import fastmodel
from fastmodel import ContactFunctions, FastModelError, Placement
from meshes import Box, Sphere, TexelArray
from tests.support import cover_data
from tests.support.array_modules import MODULES, open_module

ARRAY = TexelArray.grid(5, 4, 3.4e-3)
PARAMETERS = cover_data.parameters(ARRAY)
FUNCTIONS = ContactFunctions(PARAMETERS)
GRID = FUNCTIONS.grid
SHAPE = (GRID.rows, GRID.columns)
OWN = PARAMETERS.surface.compliance[0, 0] / (GRID.edge[0] * GRID.edge[1])
INF = np.inf


@pytest.fixture(params=MODULES)
def xp(request):
    return open_module(request.param)


def places(fine=1):
    """x and y of the points of a gap image [m]."""
    x, y = (
        low + (np.arange(n * fine) + 0.5) * e / fine for low, n, e in zip(GRID.low, SHAPE[::-1], GRID.edge, strict=True)
    )
    return np.meshgrid(x, y)


def random_gaps(count, seed=0):
    """Balls, rollers, tilted faces and waves, anywhere on the array; and loads [N]."""
    rng, (x, y), gaps = np.random.default_rng(seed), places(), []
    for k in range(count):
        turn, radius = rng.uniform(0, np.pi), rng.uniform(4e-3, 30e-3)
        a, b = x - rng.uniform(-4e-3, 4e-3), y - rng.uniform(-6e-3, 6e-3)
        u, v = a * np.cos(turn) + b * np.sin(turn), b * np.cos(turn) - a * np.sin(turn)
        gap = [(u**2 + v**2) / 2 / radius, u**2 / 2 / radius, 0.02 * u - 0.01 * v, 2e-5 * np.cos(900 * u) + v**2][k % 4]
        gaps.append(np.where(np.maximum(abs(u), abs(v)) < rng.uniform(2e-3, 8e-3), gap, INF))
    return np.array(gaps), rng.uniform(0.2, 10, count)


def misplaced(found, expected, load):
    apart = np.abs(np.asarray(found, dtype=np.float64) - expected)
    return 0.5 * apart.reshape(len(load), -1).sum(axis=1) / load


def to_base(forces):
    base = GRID.build_base_forces(PARAMETERS.surface, ARRAY)
    return np.array([base.from_window(each, (0, 0)) for each in forces])


def test_without_iterations_forces_are_those_of_the_elastic_foundation():
    """Springs under the cells carry the load at one depth, and a world that tilts turns by the missing moments."""
    gap, load = random_gaps(12, seed=1)
    spring = PARAMETERS.surface.foundation_modulus() * GRID.edge[0] * GRID.edge[1]
    found = FUNCTIONS.forces(gap, load, iterations=0)
    depth = np.array(
        [
            (forces[forces > 0] / spring + each[forces > 0]).mean()
            for forces, each in zip(found.cell_forces, gap, strict=True)
        ]
    )
    expected = spring * np.maximum(depth[:, None, None] - gap, 0)
    assert misplaced(found.cell_forces, expected, load).max() < 1e-8
    np.testing.assert_allclose(found.cell_forces.sum(axis=(1, 2)), load, rtol=1e-12)
    np.testing.assert_allclose(found.texel_forces, to_base(expected), atol=1e-7)


@pytest.mark.parametrize("shape", ["face", "free face", "ball"])
def test_points_within_cells_give_what_a_simulated_press_gives(shape):
    """With 4 x 4 points a cell, the shares of partly covered cells are those of the method `cover`."""
    place, yaw, load, free = np.array([0.4e-3, -0.7e-3]), 0.6 * (shape == "face"), 4.0, shape == "free face"
    body = Sphere(radius=8e-3) if shape == "ball" else Box(size=(7e-3, 5e-3, 5e-3))
    placement = Placement(indenter=body, load=load, at=place, yaw=yaw, guided=not free, centre=(1e-3 * free, 0.0))
    pressed = fastmodel.indent_together(PARAMETERS, [placement], contact="cover")
    a, b = (each - at for each, at in zip(places(4), place, strict=True))
    u, v = np.abs(a * np.cos(yaw) + b * np.sin(yaw)), np.abs(b * np.cos(yaw) - a * np.sin(yaw))
    rim = 0.125 * GRID.mean_edge
    gap = np.where((u < 3.5e-3 + rim) & (v < 2.5e-3 + rim), 0.0, INF)
    if shape == "ball":
        gap = np.where(u**2 + v**2 < 60e-6, -np.sqrt(np.maximum(64e-6 - u**2 - v**2, 0)), INF)
    moments = load * np.add(place, (1e-3, 0.0)) if free else None
    found = FUNCTIONS.forces(gap, load, moments, iterations=10)
    assert misplaced(found.texel_forces[None], pressed.texel_forces, np.array([load])) < 1e-3
    whole = FUNCTIONS.forces(gap[2::4, 2::4], load, moments)
    assert misplaced(whole.texel_forces[None], pressed.texel_forces, np.array([load])) < 0.1


def stack_columns(tilts):
    """Constants 1, x and y over the edge of a cell, as far as a body is free, shape (cells, 1 or 3)."""
    x, y = (each.ravel() / np.sqrt(GRID.edge[0] * GRID.edge[1]) for each in places())
    return np.column_stack([np.ones(x.size), x, y])[:, : 3 if tilts else 1]


def build_compliance():
    """Compliance of all cells, entry by entry from the table of the cover [m/N]."""
    row, column = (each.ravel() for each in np.mgrid[: SHAPE[0], : SHAPE[1]])
    table = np.zeros(SHAPE)
    known = PARAMETERS.surface.compliance[: SHAPE[0], : SHAPE[1]]
    table[: known.shape[0], : known.shape[1]] = known / (GRID.edge[0] * GRID.edge[1])
    return table[abs(row[:, None] - row), abs(column[:, None] - column)]


@pytest.mark.parametrize("tilts", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_forces_obey_the_conditions_of_the_minimum(tilts):
    """Surfaces meet where pressure acts and overlap nowhere; a free body turns by the slack of the missing moments."""
    gap, load = random_gaps(16, seed=2)
    found = FUNCTIONS.forces(gap, load, iterations=40)
    np.testing.assert_allclose(found.texel_forces, to_base(found.cell_forces), atol=1e-12)
    columns, compliance = stack_columns(tilts=True), build_compliance()
    centre = found.cell_forces.reshape(16, -1) @ columns[:, 1:] / load[:, None]
    shift = np.random.default_rng(3).uniform(-0.5, 0.5, (16, 2)) + 30 * (np.arange(16) == 15)[:, None]
    edge = np.sqrt(GRID.edge[0] * GRID.edge[1])
    moments = (centre + shift) * load[:, None] * edge
    for steps, limit in ((10, 2e-3), (40, 1e-9)):
        forces = FUNCTIONS.forces(gap, load, moments if tilts else None, steps).cell_forces.reshape(16, -1)
        missing = moments / edge - forces @ columns[:, 1:] if tilts else np.zeros((16, 2))
        for force, given, missed in zip(forces, gap.reshape(16, -1), missing, strict=True):
            under, pressed = np.isfinite(given), force > 0
            overlap = compliance @ force - columns[:, 1:] @ (4 * OWN * missed)
            overlap[under] += given[under]
            depth = overlap[pressed].mean()
            assert np.abs(overlap[pressed] - depth).max() < limit * OWN * force.sum()
            assert overlap[under].min() > depth - limit * OWN * force.sum()
            assert not force[~under].any()
        np.testing.assert_allclose(forces.sum(axis=1), load, rtol=1e-9)
    if tilts:
        assert np.median(np.abs(missing[:12] / load[:12, None])) < 0.01  # cells
        assert np.abs(missing[15]).max() > load[15]  # a centre of pressure 30 cells away cannot be reached


@pytest.mark.parametrize("tilts", [False, True])
def test_every_library_gives_the_same_forces(xp, tilts):
    gap, load = random_gaps(8, seed=4)
    fine = np.repeat(np.repeat(gap, 2, axis=1), 2, axis=2)
    fine[:, ::2] += 1e-6
    moments = np.stack([1e-3 * load, -2e-3 * load], axis=1) if tilts else None
    exact, rough = (xp.float64, 1e-10), (xp.float32, 1e-4)
    for given, steps, types in ((gap, 0, (rough,)), (fine, 8, (exact, rough))):
        expected = FUNCTIONS.forces(given, load, moments, iterations=steps)
        for dtype, limit in types:
            arrays = [None if each is None else xp.asarray(each, dtype=dtype) for each in (given, load, moments)]
            found = FUNCTIONS.forces(*arrays, iterations=steps)
            assert found.texel_forces.dtype == found.cell_forces.dtype == dtype
            assert misplaced(found.texel_forces, expected.texel_forces, load).max() < limit
            assert misplaced(found.cell_forces, expected.cell_forces, load).max() < limit


def test_worlds_do_not_depend_on_each_other_and_may_be_empty():
    gap, load = random_gaps(4, seed=5)
    gap[1], load[2] = INF, 0.0
    found = FUNCTIONS.forces(gap.reshape(2, 2, *SHAPE), load.reshape(2, 2))
    assert found.texel_forces.shape == (2, 2, ARRAY.count)
    together = found.texel_forces.reshape(4, -1)
    for world in range(4):
        np.testing.assert_allclose(together[world], FUNCTIONS.forces(gap[world], load[world]).texel_forces, atol=1e-12)
    assert not together[1:3].any()
    assert together[[0, 3]].any(axis=1).all()
    assert FUNCTIONS.forces(gap[:0], load[:0]).texel_forces.shape == (0, ARRAY.count)
    single = np.full(SHAPE, INF)
    single[12, 9] = 0.0  # a body above one cell
    assert FUNCTIONS.forces(single, 2.0).cell_forces[12, 9] == pytest.approx(2.0)
    assert FUNCTIONS.forces(single, 2.0, np.zeros(2)).cell_forces[12, 9] == pytest.approx(2.0)


def test_the_grid_ends_with_the_cover():
    array = dataclasses.replace(ARRAY, margin=(1.7e-3, 0.0))
    grid = ContactFunctions(cover_data.parameters(array)).grid
    assert (grid.rows, grid.columns) == (4 * array.rows, 4 * array.columns + 4)


@pytest.mark.parametrize("dtype", [np.float64, pytest.param(np.float32, marks=pytest.mark.slow)])
def test_forces_balance_the_load_under_any_body_and_moment(dtype):
    rng = np.random.default_rng(9)
    gap, load = random_gaps(96, seed=9)
    gap[::2] = np.where(rng.uniform(size=gap[::2].shape) < 0.01, gap[::2], INF)  # a few cells, some beside each other
    gap[::3] = rng.uniform(0, 1e-3, gap[::3].shape)
    load *= 10 ** rng.uniform(-6, 2, 96)
    moments = rng.uniform(-0.03, 0.03, (96, 2)) * load[:, None]
    for steps in (0, 10, 30):
        found = FUNCTIONS.forces(gap.astype(dtype), load.astype(dtype), moments.astype(dtype), steps)
        forces = found.cell_forces.astype(np.float64)
        carried = load * np.isfinite(gap).any(axis=(1, 2))
        np.testing.assert_allclose(forces.sum(axis=(1, 2)), carried, rtol=1e-12 if dtype is np.float64 else 1e-5)
        assert forces.min() >= 0
        assert np.isfinite(found.texel_forces).all()


@pytest.mark.filterwarnings("ignore::fastmodel.RangeWarning")
@pytest.mark.parametrize("changes", [{"table": True}, {"mask": True}])
def test_covers_with_free_sides_and_masked_texels(changes):
    surface, array = PARAMETERS.surface, ARRAY
    if "table" in changes:
        table = np.random.default_rng(0).uniform(0, 0.1, (array.count, 4 * array.rows, 4 * array.columns))
        surface = dataclasses.replace(surface, table=table)
    else:
        array = dataclasses.replace(array, active=np.arange(array.count) % 5 != 2)
    functions = ContactFunctions(cover_data.parameters(array, surface=surface))
    gap = np.zeros((functions.grid.rows, functions.grid.columns))
    found = functions.forces(gap, 3.0)
    base = functions.grid.build_base_forces(surface, array)
    np.testing.assert_allclose(found.texel_forces, base.from_window(found.cell_forces, (0, 0)), atol=1e-12)
    assert not found.texel_forces[~array.active].any()


def test_a_contact_at_the_end_of_the_grid_is_told_with_its_share():
    """A margin that is stated ends the cover, and nothing is told."""
    x, _ = places()
    gap = np.stack([np.where(x < GRID.low[0] + 4e-3, 0.0, INF), np.where(abs(x) < 3e-3, 0.0, INF), x * 0 + INF])
    load = np.array([3.0, 2.0, 0.0])
    functions = ContactFunctions(PARAMETERS)
    with pytest.warns(fastmodel.RangeWarning, match="outermost cells bear 0.* margin in") as caught:
        found, _ = functions.forces(gap, load), functions.forces(gap, load)
    inside = found.cell_forces[:, 1:-1, 1:-1].sum(axis=(1, 2))
    assert found.at_end == pytest.approx([1 - inside[0] / 3, 1 - inside[1] / 2, 0])
    assert found.at_end[0] > 0.2
    assert len(caught) == 1
    stated = dataclasses.replace(ARRAY, margin=(3.4e-3, 3.4e-3))
    held = ContactFunctions(dataclasses.replace(PARAMETERS, array=stated)).forces(gap, load)
    np.testing.assert_array_equal(held.at_end, 0)
    np.testing.assert_allclose(held.texel_forces, found.texel_forces, atol=1e-9)


def test_the_share_at_the_end_is_computed_in_every_library(xp):
    point = xp.asarray([[GRID.low[0] + 1e-5, 0.0, 0.0], [0.0, 0.0, 0.0]])
    force = xp.asarray([[0.0, 0.0, -1.0], [0.0, 0.0, -3.0]])
    with pytest.warns(fastmodel.RangeWarning, match="bear 0.25"):
        found = ContactFunctions(PARAMETERS).from_contacts(xp.asarray([0, 0]), point, force, 1)
    assert float(found.at_end[0]) == pytest.approx(0.25, abs=1e-6)


def test_flat_contacts_become_loads_and_moments_of_worlds(xp):
    gap, _ = random_gaps(3, seed=6)
    world = np.array([0, 2, 2, -1, 0, 2])
    points = np.random.default_rng(0).uniform(-4e-3, 4e-3, (6, 3))
    forces = np.array([[0.1, 0.2, -each] for each in (1.0, 2.0, 0.5, np.nan, 3.0, 1.5)])
    arrays = [xp.asarray(each) for each in (world, points, forces)]
    found = FUNCTIONS.from_contacts(*arrays, 3, xp.asarray(gap))
    np.testing.assert_allclose(np.asarray(found.load), [4.0, 0.0, 4.0])
    share = np.array([1.0, 2.0, 0.5, 0.0, 3.0, 1.5])[:, None] * points[:, :2]
    moments = np.array([share[world == k].sum(axis=0) for k in range(3)])
    expected = FUNCTIONS.forces(gap, np.array([4.0, 0.0, 4.0]), moments)
    np.testing.assert_allclose(np.asarray(found.cell_forces), expected.cell_forces, atol=1e-9)
    guided = FUNCTIONS.from_contacts(*arrays, 3, xp.asarray(gap), tilts=False)
    expected = FUNCTIONS.forces(gap, np.array([4.0, 0.0, 4.0]))
    np.testing.assert_allclose(np.asarray(guided.cell_forces), expected.cell_forces, atol=1e-9)
    alone = np.asarray(FUNCTIONS.from_contacts(*arrays, 3).cell_forces)
    np.testing.assert_allclose(alone.sum(axis=(1, 2)), [4.0, 0.0, 4.0])
    for k, place in enumerate(places()):
        np.testing.assert_allclose((alone * place).sum(axis=(1, 2)), moments[:, k], atol=1e-12)


def test_depths_at_texels_become_gap_images(xp):
    x, y = places()
    centres = ARRAY.centres[:, :2]
    plane = FUNCTIONS.from_depths(xp.asarray(1e-4 + 1e-3 * centres[:, 0] - 2e-3 * centres[:, 1]), 5.0)
    expected = FUNCTIONS.forces(-1e-3 * x + 2e-3 * y, 5.0)
    np.testing.assert_allclose(np.asarray(plane.cell_forces), expected.cell_forces, atol=1e-9)
    ball = 4e-4 - (centres**2).sum(axis=1) / 40e-3
    found = FUNCTIONS.from_depths(xp.asarray(np.stack([ball, 0 * ball])))
    modulus, area = PARAMETERS.surface.foundation_modulus(), ARRAY.pitch[0] * ARRAY.pitch[1]
    load = modulus * area * np.maximum(ball, 0).sum()
    np.testing.assert_allclose(np.asarray(found.load), [load, 0.0])
    expected = FUNCTIONS.forces((x**2 + y**2) / 40e-3, load)
    assert misplaced(found.texel_forces[:1, ...], expected.texel_forces, np.array([load])).max() < 0.01
    assert not np.asarray(found.texel_forces[1, ...]).any()


GAP = np.zeros((2, *SHAPE))
BAD = {
    f"gap has shape (2, {SHAPE[0]}, 12); its last two dimensions": lambda: FUNCTIONS.forces(GAP[..., ::2], np.ones(2)),
    "gap has elements of type int64; convert them to float32 or float64": lambda: FUNCTIONS.forces(
        GAP.astype(int), np.ones(2)
    ),
    "gap[1, 3, 2] is nan; give a distance, or inf where there is no body": lambda: FUNCTIONS.forces(
        np.where(np.arange(GAP.size).reshape(GAP.shape) == 2 + SHAPE[1] * (3 + SHAPE[0]), np.nan, GAP), np.ones(2)
    ),
    "load has shape (3,); give shape (2,)": lambda: FUNCTIONS.forces(GAP, np.ones(3)),
    "load has elements of type float32; convert them to float64": lambda: FUNCTIONS.forces(GAP, np.ones(2, np.float32)),
    "load[1] is -1.0; give a finite force from 0 on": lambda: FUNCTIONS.forces(GAP, np.array([1.0, -1.0])),
    "load is no array of numbers; give one of numpy": lambda: FUNCTIONS.forces(GAP, [1.0, "x"]),
    "gap is no array of numbers; give one of numpy": lambda: FUNCTIONS.forces([[1.0], [1.0, 2.0]], 1.0),
    "load is nan; give a finite force": lambda: FUNCTIONS.forces(GAP[0], np.nan),
    "moments has shape (2, 3); give shape (2, 2)": lambda: FUNCTIONS.forces(GAP, np.ones(2), np.ones((2, 3))),
    "iterations must be a whole number from 0 on": lambda: FUNCTIONS.forces(GAP, np.ones(2), iterations=-1),
    "depths has shape (2, 21); its last dimension must be 20 texels": lambda: FUNCTIONS.from_depths(np.ones((2, 21))),
    "points has shape (4, 2); give shape (4, 3)": lambda: FUNCTIONS.from_contacts(
        np.zeros(4, int), np.ones((4, 2)), np.ones((4, 3)), 1
    ),
    "world[0] is 3.0; give -1 to 1": lambda: FUNCTIONS.from_contacts(
        np.array([3]), np.ones((1, 3)), np.ones((1, 3)), 2
    ),
    "world has type float64, shape (1,); give integers (1,)": lambda: FUNCTIONS.from_contacts(
        np.array([0.0]), np.ones((1, 3)), np.ones((1, 3)), 2
    ),
    "forces[0, 0] is nan; give a finite force": lambda: FUNCTIONS.from_contacts(
        np.array([0]), np.ones((1, 3)), np.full((1, 3), np.nan), 2
    ),
    "ContactFunctions needs a flat, regular array": lambda: ContactFunctions(
        cover_data.parameters(ARRAY, surface=None)
    ),
    "parameters must be the Parameters of a sensor": lambda: ContactFunctions(ARRAY),
}


@pytest.mark.parametrize("message", BAD)
def test_bad_input_is_refused_in_one_line(message):
    with pytest.raises(FastModelError, match=re.escape(message)) as raised:
        BAD[message]()
    assert "\n" not in str(raised.value)


@pytest.mark.slow
def test_a_compiled_world_with_nan_disturbs_no_other():
    jnp = open_module("jax")
    import jax

    gap, load = random_gaps(4, seed=7)
    expected = FUNCTIONS.forces(gap, load).texel_forces
    gap[1, 3, 3] = np.nan
    found = np.asarray(jax.jit(FUNCTIONS.forces)(jnp.asarray(gap), jnp.asarray(load * [1, 1, np.nan, -1])).texel_forces)
    np.testing.assert_allclose(found[0], expected[0], atol=1e-10)
    assert np.isnan(found[1:3]).all()
    assert not found[3].any()


@pytest.mark.slow
@pytest.mark.parametrize("library", ["jax", "torch"])
@pytest.mark.parametrize("steps", [0, 20])
def test_gradients_are_those_of_finite_differences(library, steps):
    xp, rng = open_module(library), np.random.default_rng(8)
    gap, load = random_gaps(8, seed=8)
    gap = np.repeat(np.repeat(gap, 2, axis=1), 2, axis=2) + rng.uniform(0, 1e-6, (8, 2 * SHAPE[0], 2 * SHAPE[1]))
    forces = FUNCTIONS.forces(gap, load).cell_forces
    moments = np.stack([(forces * each).sum(axis=(1, 2)) for each in places()], axis=1) + 1e-4
    weights = rng.standard_normal((8, ARRAY.count))

    def measure(gap, load, moments, xp=np, steps=steps):
        found = FUNCTIONS.forces(gap, load, moments, iterations=steps).texel_forces
        return xp.sum(found * xp.asarray(weights), axis=-1)

    given = [xp.asarray(each) for each in (gap, load, moments)]
    if library == "jax":
        import jax

        slopes = jax.grad(lambda *each: xp.sum(measure(*each, xp=xp)), argnums=(0, 1, 2))(*given)
    else:
        given = [each.requires_grad_() for each in given]
        xp.sum(measure(*given, xp=xp)).backward()
        slopes = [each.grad for each in given]
    for k, size in enumerate((1e-10, 1e-5, 1e-7)):
        step = size * rng.standard_normal((gap, load, moments)[k].shape)
        ends = []
        for sign in (1, -1):
            moved = [gap, load, moments]
            moved[k] = moved[k] + sign * np.where(np.isfinite(moved[k]), step, 0)
            ends.append(measure(*moved, steps=2 * steps))
        slope = (np.asarray(slopes[k]) * step).reshape(8, -1).sum(axis=1)
        np.testing.assert_allclose(slope, (ends[0] - ends[1]) / 2, rtol=1e-6, atol=1e-6 * np.abs(slope).max())


@pytest.mark.bench  # the slow tests have the gradients
@pytest.mark.slow
def test_a_training_loop_is_deterministic_and_learns():
    """In 64 worlds, 1000 steps find loads and positions of balls from texel forces."""
    jnp = open_module("jax")
    import jax

    array = TexelArray.grid(4, 4, 3.4e-3)
    functions = ContactFunctions(cover_data.parameters(array, surface=cover_data.cells(array, 2, 6)))
    rows, columns = functions.grid.rows, functions.grid.columns
    y, x = np.mgrid[:rows, :columns] - np.array([rows - 1, columns - 1]).reshape(2, 1, 1) / 2

    def touch(guess):
        place = guess[:, :2, None, None]
        gap = 1e-4 * ((x - place[:, 0]) ** 2 + (y - place[:, 1]) ** 2)
        return functions.forces(gap, jnp.exp(guess[:, 2]), iterations=5).texel_forces

    target = touch(jnp.asarray(np.random.default_rng(0).uniform(-1.5, 1.5, (64, 3))))

    @jax.jit
    def step(guess, speed):
        lost, slope = jax.value_and_grad(lambda guess: ((touch(guess) - target) ** 2).sum())(guess)
        speed = 0.9 * speed - 0.02 * slope
        return guess + jnp.clip(speed, -0.1, 0.1), speed, lost

    def train():
        guess, speed, lost = jnp.zeros((64, 3)), jnp.zeros((64, 3)), []
        for _ in range(1000):
            guess, speed, value = step(guess, speed)
            lost.append(float(value))
        return np.asarray(guess), lost

    (guess, lost), (again, other) = train(), train()
    np.testing.assert_array_equal(guess, again)
    assert lost == other
    assert lost[-1] < 1e-3 * lost[0]
