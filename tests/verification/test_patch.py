"""Linear fields and rigid motion are exact on any cloud, uniform stress where points are a rule in every cell.

On other clouds the error of uniform stress under tractions falls with the number of points. From four points a cell
on, fitted weights make it several times smaller. A square and a disc lie on a grid of cells h = 1/6 of their width,
off its lines, so that it cuts cells of every size. Their points are regular, jittered or thrown at random. Errors are
relative to the uniform field.

Remaining errors of uniform stress come from slivers with too few points for their moments. From 36 points a cell on,
the lumping of tractions adds to them. Where displacements are prescribed, it is the nearly dependent rows of
supports, left out from 16 points a cell on. With exact nodal tractions, and with all rows kept, 2e-6 to 3e-3 remain
at 64 points a cell.
"""

import re
from functools import cache

import numpy as np
import pytest
from hypothesis import example, given, reject, settings
from hypothesis import strategies as st
from ledger import Row, tabulated, texts
from skfem import MeshQuad
from skfem.quadrature import get_quadrature
from skfem.refdom import RefQuad

from skmpm import (
    Body,
    LinearElastic,
    Load,
    NeoHookean,
    Scene,
    Scheme,
    StepFailed,
    Support,
    box,
    disc,
    initial,
    linear,
    simulate,
    step,
)
from skmpm.material import Anchored
from skmpm.points import Points
from skmpm.step.derived import bulk_of
from skmpm.step.regrid import regridded_state

E, CELL = 1e6, 1 / 6
CORNER = np.array([0.37, 0.21]) * CELL
SOLID = LinearElastic(E, 0.3, 1000.0)
LAWS = {law.__name__: law(E, 0.3, 1000.0) for law in (LinearElastic, NeoHookean)}
STRAIN = 1e-4 * np.array([[1.0, 0.4], [0.4, -0.7]])
SOLVERS = {"banded": linear.banded, "amg": linear.amg}


# Clouds: `per` points per cell and direction on average.


def regular(per, rng):
    return box(CORNER, (1, 1), spacing=CELL / per)


def jittered(per, rng):
    """Inner points moved by up to 0.4 of their spacing in each direction, volumes kept."""
    points = regular(per, rng)
    return moved(points, lambda x: x + 0.4 * CELL / per * rng.uniform(-1, 1, x.shape))


def thrown(per, rng):
    """Inner points anywhere in the square, of equal volumes: cells with far too many and too few."""
    points = regular(per, rng)
    return moved(points, lambda x: CORNER[:, None] + rng.uniform(0.01, 0.99, x.shape), even=True)


def moved(points, to, even=False):
    """The cloud with its inner points elsewhere, the boundary as it is."""
    inner = np.setdiff1d(np.arange(points.size), points.outline[0])
    x, volume = points.x.copy(), points.volume.copy()
    x[:, inner] = to(x[:, inner])
    if even:
        volume[inner] = volume[inner].mean()
    return Points(x, volume, points.outline)


def round_one(per, rng):
    return disc(CORNER + 0.5, 0.5, spacing=CELL / per)


CLOUDS = {"regular": regular, "jittered": jittered, "random": thrown, "disc": round_one}


def gauss(cells=6):
    """The four Gauss points of each cell of a square that fits the grid, and no outline."""
    mesh = MeshQuad.init_tensor(*2 * [np.linspace(0, 1, cells + 1)])
    X, W = get_quadrature(RefQuad, 3)
    return Points(mesh.mapping().F(X).reshape(2, -1), np.tile(W / cells**2, cells**2))


def cloud_of(name, per, seed=0):
    return CLOUDS[name](per, np.random.default_rng(seed))


# Uniform stress.


def at(place):
    return lambda x: np.abs(x - place[:, None]).max(axis=0) < 1e-12


def held(points, places):
    """Supports that give these points a linear displacement."""
    return [Support(at(x), velocity=STRAIN @ (x - CORNER)) for x in places.T]


def pulled(points):
    """The tractions of the uniform stress: half of what acts on the edges beside each boundary point."""
    boundary = points.x[:, points.outline[0]]
    edge = np.roll(boundary, -1, axis=1) - boundary
    traction = uniform_stress() @ np.stack([edge[1], -edge[0]])
    force = 0.5 * (traction + np.roll(traction, 1, axis=1))
    return [Load(at(x), f) for x, f in zip(boundary.T, force.T, strict=True)]


def pulled_by_the_rule(points, spacing):
    """The same for a `box`, by the weights that its points have along the edges: exact for linear functions."""
    loads, (low, high) = [], (points.x.min(axis=1), points.x.max(axis=1))
    for side in points.outline[0]:
        x = points.x[:, side]
        normal = (np.abs(x - high) < 1e-12).astype(float) - (np.abs(x - low) < 1e-12)
        loads.append(Load(at(x), uniform_stress() @ normal * points.volume[side] / (spacing / 4)))
    return loads


def uniform_stress():
    return SOLID.stress((np.eye(2) + STRAIN)[:, :, None])[:, :, 0]


def stress_error(state):
    """Relative L2 error of the stress."""
    exact = uniform_stress()[:, :, None]
    error = np.sum((state.stress - exact) ** 2, axis=(0, 1)) @ state.volume
    return float(np.sqrt(error / (np.sum(exact**2) * state.volume.sum())))


@cache
def patch(name, per, how, fitted=True, seed=0, solver=linear.banded):
    """Stress error of a cloud whose boundary is `held` in a linear field or `pulled` by its tractions."""
    points = cloud_of(name, per, seed)
    boundary = points.x[:, points.outline[0]]
    options = {"supports": held(points, boundary)} if how == "held" else {"loads": pulled(points)}
    scheme = Scheme(inertia=False, moment_fitting=fitted, linear=solver)
    scene = Scene([Body(points, SOLID)], cell=CELL, **options)
    return stress_error(step(scene, initial(scene, scheme=scheme), 1.0, scheme=scheme))


def fitting(intervals):
    """Stress error on the unit square, whose grid fits: Gauss points in a held ring of cells, or a pulled box."""
    if intervals is None:
        points = gauss()
        inner = (points.x > CELL).all(axis=0) & (points.x < 1 - CELL).all(axis=0)
        options = {"supports": held(points, points.x[:, ~inner])}
    else:
        points = box((0, 0), (1, 1), spacing=CELL / intervals)
        options = {"loads": pulled_by_the_rule(points, CELL / intervals)}
    scheme = Scheme(inertia=False, newton_tol=1e-11)
    scene = Scene([Body(points, SOLID)], cell=CELL, **options)
    return stress_error(step(scene, initial(scene, scheme=scheme), 1.0, scheme=scheme))


GOOD = {"Gauss points": None, "box of one interval a cell": 1, "box of three intervals a cell": 3}


@pytest.mark.parametrize("cloud", GOOD)
def test_uniform_stress_is_exact_for_points_that_are_a_rule_in_every_cell(cloud):
    """Goal: 1e-10. Rules exact for linear functions balance a uniform stress to rounding."""
    assert fitting(GOOD[cloud]) < 1e-10


@pytest.mark.parametrize("how", ["pulled", "held"])
@pytest.mark.parametrize("cloud", CLOUDS)
def test_uniform_stress_on_irregular_clouds_improves_with_points_and_with_fitted_weights(cloud, how):
    """No goal but to measure it: at 16 points a cell the bounds are what is achieved, with a fifth to spare.

    Weights fitted to the moments of each cell are better than volumes in every one.
    """
    error, plain = patch(cloud, 4, how), patch(cloud, 4, how, fitted=False)
    assert error < {"regular": 0.027, "jittered": 0.027, "random": 0.06, "disc": 0.0075}[cloud]
    assert error < 0.4 * plain
    assert error < 0.7 * patch(cloud, 2, how) or error < 0.025


@pytest.mark.parametrize("cloud", ["jittered", "disc"])
def test_banded_and_amg_agree_on_the_patch(cloud):
    """Stress errors to 1e-6 of the stress: amg's tolerance of 1e-10 times the condition of the matrix."""
    errors = [patch(cloud, 3, "pulled", solver=solver) for solver in SOLVERS.values()]
    assert errors[0] == pytest.approx(errors[1], abs=1e-6)


# Linear fields and rigid motion, on any cloud.


def any_cloud(seed, fewest=2, largest=1.0):
    """Random points of random volumes: cells with one point, holes, slivers; no outline."""
    rng = np.random.default_rng(seed)
    n, size = int(rng.integers(fewest, 60)), rng.uniform(0.1, largest)
    x = rng.uniform(-2, 2, size=(2, 1)) + size * rng.uniform(size=(2, n))
    return rng, Points(x, rng.uniform(0.01, 0.1, n) * CELL**2)


def field_errors(seed, law):
    """Linear displacement: error of F and of the stress. Turned by half a radian: stress and force, over E.

    Of nodal fields, which the gradients of the shape functions at the points must give back.
    """
    rng, points = any_cloud(seed)
    solid = LAWS[law]
    scene = Scene([Body(points, solid)], cell=CELL)
    bulk = bulk_of(scene, regridded_state(scene, initial(scene), Scheme())[0], Scheme())
    position, one = bulk.assembly.grid.position, np.eye(2)[:, :, None]
    H = 0.1 * rng.normal(size=(2, 2))
    at = bulk.at((H @ position + rng.normal(size=(2, 1))).T.ravel())
    field = np.abs(at.F - one - H[:, :, None]).max()
    expected = Anchored(solid).cauchy(one + H[:, :, None], solid.stress(one + H[:, :, None]))
    stress = np.abs(bulk.cauchy(at) - expected).max() / E
    a = 0.5
    R = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    turn = R - np.eye(2) if law == "NeoHookean" else 0.01 * np.array([[0.0, -1.0], [1.0, 0.0]])
    at = bulk.at((turn @ position).T.ravel())
    rigid = max(np.abs(bulk.cauchy(at)).max(), np.abs(bulk.force(at)).max() / CELL) / E
    return max(field, stress), rigid


@pytest.mark.parametrize("law", LAWS)
@settings(max_examples=40)
@given(seed=st.integers(0, 2**32 - 1))
def test_linear_fields_and_rotations_are_exact_on_any_cloud(law, seed):
    """To 1e-11: rounding of positions of a few units in cells of 1/6. Hooke's law turns infinitesimally."""
    assert max(field_errors(seed, law)) < 1e-11


def flight_errors(seed):
    """A cloud flies in a linear velocity field, too soft to resist: errors of x, v and F after three steps."""
    rng, points = any_cloud(seed)
    A, b = 0.5 * rng.normal(size=(2, 2)), rng.normal(size=2)
    dust = NeoHookean(1e-12, 0.3, 1000.0)
    body = Body(points, dust, velocity=lambda x: A @ x + b[:, None])
    *_, state = simulate(Scene([body], cell=CELL), dt=0.01, until=0.03)
    X = points.x
    v = A @ X + b[:, None]
    return max(
        np.abs(state.x - X - 0.03 * v).max(),
        np.abs(state.v - v).max(),
        np.abs(state.F - np.eye(2)[:, :, None] - 0.03 * A[:, :, None]).max(),
    )


@settings(max_examples=15)
@given(st.integers(0, 2**32 - 1))
def test_a_linear_velocity_field_is_carried_on_exactly_by_any_cloud(seed):
    """To 1e-9: gradients of random clouds are taken by differences of step 1e-4 cells."""
    assert flight_errors(seed) < 1e-9


def carried_errors(law, seed):
    """A cloud held at two points that go round a circle of 60 degrees or, Hooke's, along: strain, stress over E."""
    _, points = any_cloud(seed, 50, 0.45)
    angles = np.radians([0.0, 20.0, 40.0, 60.0]) if law == "NeoHookean" else np.zeros(4)

    def path(X):
        turns = [np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]) for a in angles]
        places = [turn @ X + (0.3 * k, 0.1 * k) for k, turn in enumerate(turns)]
        return lambda t: places[int(t) + 1] - places[int(t)]

    far = points.x[:, [points.x[0].argmin(), points.x[0].argmax()]]
    supports = [Support(at(x), velocity=path(x)) for x in far.T]
    scene = Scene([Body(points, LAWS[law])], cell=CELL, supports=supports)
    *_, state = simulate(scene, dt=1.0, until=3.0, scheme=Scheme(inertia=False, newton_tol=1e-10))
    strain = np.einsum("jip,jkp->ikp", state.F, state.F) - np.eye(2)[:, :, None]
    return np.abs(strain).max(), np.abs(state.stress).max() / E


@pytest.mark.parametrize("law", LAWS)
@settings(max_examples=10)
@given(seed=st.integers(0, 2**32 - 1))
@example(seed=129132)  # is refused
def test_a_cloud_carried_by_two_of_its_points_moves_rigidly(law, seed):
    """To 1e-8, Newton's tolerance of 1e-10 times the softest modes of clouds of 50 points in up to 16 cells.

    One cloud in 250 is refused, since too many of its cells hold one point; that must be what the error says.
    """
    try:
        errors = carried_errors(law, seed)
    except StepFailed as refused:
        assert re.search(r"\d of its \d+ cells hold one point, which leaves motions without stiffness", str(refused))
        reject()
    assert max(errors) < 1e-8


# The table and the figure.

PER = (1, 2, 3, 4, 6, 8)


def irregular(name, how, fitted, per=PER):
    """Stress errors, for random clouds the median of five."""
    seeds = range(1 if name in ("regular", "disc") else 5)
    return [float(np.median([patch(name, p, how, fitted, seed) for seed in seeds])) for p in per]


def rows():
    seeds = range(200)
    linear_field, turned = np.max([field_errors(s, law) for s in seeds for law in LAWS], axis=0)
    flight = max(flight_errors(s) for s in range(30))
    carried = np.max([carried_errors(law, s) for s in range(15) for law in LAWS])
    clouds = "random clouds of 2 to 60 points"
    out = [
        Row(
            problem=problem,
            reference="the field itself",
            h=clouds,
            error=tabulated(["largest error"], {what: texts([error])}),
            rate="-",
            goal="exact on any cloud: met",
            test=test,
        )
        for problem, error, what, test in (
            (
                "linear displacement",
                linear_field,
                "gradients, stress over E, 400 clouds",
                "test_linear_fields_and_rotations_are_exact_on_any_cloud",
            ),
            (
                "rotation by half a radian",
                turned,
                "stress, nodal forces over E, 400 clouds",
                "test_linear_fields_and_rotations_are_exact_on_any_cloud",
            ),
            (
                "flight in a linear velocity field, 3 steps",
                flight,
                "x, v, F, 30 clouds",
                "test_a_linear_velocity_field_is_carried_on_exactly_by_any_cloud",
            ),
            (
                "held at two points that turn by 60 degrees",
                carried,
                "strain, stress over E, 30 clouds",
                "test_a_cloud_carried_by_two_of_its_points_moves_rigidly",
            ),
        )
    ]
    out.append(
        Row(
            problem="uniform stress, a rule in every cell",
            reference="the stress itself",
            h="1/6",
            error=tabulated(GOOD, {"relative L2": texts([fitting(intervals) for intervals in GOOD.values()])}),
            rate="-",
            goal="1e-10: met",
            test="test_uniform_stress_is_exact_for_points_that_are_a_rule_in_every_cell",
        )
    )
    ends = {"pulled": "tractions", "held": "a linear displacement"}
    for how, prescribed in ends.items():
        for name in CLOUDS:
            lines = {
                weights: texts(irregular(name, how, fitted))
                for weights, fitted in (("fitted weights", True), ("volumes as weights", False))
            }
            out.append(
                Row(
                    problem=f"uniform stress, {name} cloud",
                    reference="the stress itself",
                    h=f"h = 1/6, off the grid lines, {prescribed} at the boundary points, relative L2",
                    error=tabulated([f"{p * p} a cell" for p in PER], lines),
                    rate="-",
                    goal="-",
                    test="test_uniform_stress_on_irregular_clouds_improves_with_points_and_with_fitted_weights",
                )
            )
    return out


def figures(folder):
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(7.5, 3.6), sharey=True, layout="constrained")
    for axis, how in zip(axes, ("pulled", "held"), strict=True):
        for colour, name in zip(("C0", "C1", "C2", "C3"), CLOUDS, strict=True):
            for fitted, style in ((False, "o--"), (True, "s-")):
                label = f"{name}, {'fitted' if fitted else 'volumes'}"
                axis.loglog(np.square(PER), irregular(name, how, fitted), colour + style, label=label, ms=4)
        axis.set(xlabel="points per cell", title=f"boundary {how}")
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("relative L2 error of the stress")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncol=4, fontsize=7)
    figure.savefig(folder / "patch.png", dpi=100)
    plt.close(figure)
    return {
        "patch.png": "Uniform stress on clouds independent of the grid: error against points per cell,"
        " with weights fitted to the cells' moments and with volumes as weights."
    }
