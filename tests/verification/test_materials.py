"""Materials against textbook solutions: uniaxial, equibiaxial, confined and shear tests, derivatives, objectivity.

The tests load one grid cell full of material points, where the deformation is uniform: an error is one of the law,
its tangent, the load or the supports. Quasi-static steps with a Newton tolerance of 1e-12.
"""

import numpy as np
import pytest
from ledger import Row, numbers
from scipy.optimize import brentq

from skmpm import (
    Body,
    LinearElastic,
    Load,
    MooneyRivlin,
    NeoHookean,
    Ogden,
    Scene,
    Scheme,
    Support,
    Yeoh,
    box,
    linear,
    simulate,
)
from skmpm.material import Anchored, is_linear, product
from skmpm.points import Points

E = 1e6
SCHEME = Scheme(inertia=False, newton_tol=1e-12)
LAWS = (LinearElastic, NeoHookean)


def mooney_rivlin(E, nu, density):
    """Mooney-Rivlin by its small-strain constants, 0.35 of the shear modulus in I2."""
    mu, bulk = E / (2 * (1 + nu)), E / (3 * (1 - 2 * nu))
    return MooneyRivlin(0.325 * mu, 0.175 * mu, bulk, density)


def yeoh(E, nu, density):
    """Yeoh's solid, softening before it stiffens."""
    mu, bulk = E / (2 * (1 + nu)), E / (3 * (1 - 2 * nu))
    return Yeoh(0.5 * mu, -5e-3 * mu, 1e-3 * mu, bulk, density)


def ogden(E, nu, density):
    """Ogden's three terms for rubber (1972), scaled."""
    mu, bulk = E / (2 * (1 + nu)), E / (3 * (1 - 2 * nu))
    return Ogden(tuple(np.array([6.3, 0.012, -0.1]) * mu / 4.225), (1.3, 5.0, -2.0), bulk, density)


RUBBERS = (mooney_rivlin, yeoh, ogden)
NAMES = "LinearElastic, NeoHookean, MooneyRivlin, Yeoh, Ogden"
NU = (0.0, 0.3, 0.49)
STRETCHES = (0.5, 0.8, 1.3, 2.0)
SHEARS = (0.1, 0.5, 1.5)


# Closed forms: nominal stress [Pa] and what comes with it, by stretch or shear.


def principal(solid, stretches):
    """Principal Kirchhoff stresses l dW/dl of rubber, (3,) [Pa], as the books write them, by principal stretches."""
    stretches = np.asarray(stretches, dtype=float)
    J = stretches.prod()
    b, U = stretches * J ** (-1 / 3), solid.bulk * (J**2 - 1) / 2

    def deviator(power):
        return b**power - (b**power).mean()

    if isinstance(solid, MooneyRivlin):
        return 2 * solid.c10 * deviator(2) - 2 * solid.c01 * deviator(-2) + U
    if isinstance(solid, Yeoh):
        first = (b**2).sum() - 3
        return 2 * (solid.c10 + 2 * solid.c20 * first + 3 * solid.c30 * first**2) * deviator(2) + U
    return sum(m * deviator(a) for m, a in zip(solid.mu, solid.alpha, strict=True)) + U


def is_rubber(solid):
    return isinstance(solid, MooneyRivlin | Yeoh | Ogden)


def uniaxial(solid, stretch):
    """Nominal stress and lateral stretch at no lateral stress, in plane strain."""
    lam, mu = solid.lame
    if is_rubber(solid):
        lateral = brentq(lambda b: principal(solid, (stretch, b, 1.0))[1], 0.05, 5.0, xtol=1e-15, rtol=1e-14)
        return principal(solid, (stretch, lateral, 1.0))[0] / stretch, lateral
    if is_linear(solid):
        strain = stretch - 1
        return E / (1 - solid.nu**2) * strain, 1 - solid.nu / (1 - solid.nu) * strain
    lateral = brentq(lambda b: mu * (b**2 - 1) + lam * np.log(stretch * b), 0.05, 5.0, xtol=1e-15, rtol=1e-14)
    return mu * (stretch - 1 / stretch) + lam * np.log(stretch * lateral) / stretch, lateral


def confined(solid, stretch):
    """Nominal stresses along and across, no lateral strain."""
    lam, mu = solid.lame
    if is_rubber(solid):
        along, across, _ = principal(solid, (stretch, 1.0, 1.0))
        return along / stretch, across
    if is_linear(solid):
        return (lam + 2 * mu) * (stretch - 1), lam * (stretch - 1)
    return mu * (stretch - 1 / stretch) + lam * np.log(stretch) / stretch, lam * np.log(stretch)


def equibiaxial(solid, stretch):
    """Nominal stress at F = diag(l, l), in plane strain."""
    lam, mu = solid.lame
    if is_rubber(solid):
        return principal(solid, (stretch, stretch, 1.0))[0] / stretch
    if is_linear(solid):
        return 2 * (lam + mu) * (stretch - 1)
    return mu * (stretch - 1 / stretch) + 2 * lam * np.log(stretch) / stretch


def sheared(solid, shear):
    """Cauchy stress (2, 2) of simple shear."""
    _, mu = solid.lame
    if is_rubber(solid):
        long = (shear + np.hypot(shear, 2.0)) / 2.0
        axes = np.array([[long, 1.0], [1.0, -long]]).T / np.hypot(long, 1.0)
        return axes @ np.diag(principal(solid, (long, 1 / long, 1.0))[:2]) @ axes.T
    return mu * np.array([[0.0 if is_linear(solid) else shear**2, shear], [shear, 0.0]])


# One cell.


def edge(axis, value):
    return lambda x: np.abs(x[axis] - value) < 1e-9


SLIDING = (Support(edge(0, 0.0), velocity=(0, None)), Support(edge(1, 0.0), velocity=(None, 0)))


def one_cell(solid, supports, loads=(), steps=5, scheme=SCHEME):
    """The unit square in a grid cell of its size, at t = 1."""
    points = box((0, 0), (1, 1), spacing=1 / 3)
    scene = Scene([Body(points, solid)], cell=1.0, supports=supports, loads=loads)
    *_, state = simulate(scene, dt=1 / steps, until=1.0, scheme=scheme)
    return state


def spread(values):
    """Largest deviation of point values (..., n) from their mean."""
    return np.abs(values - values.mean(axis=-1, keepdims=True)).max()


def compressed(solid, stretch, **options):
    """The unit square whose right side a support pushes; it may slide along it.

    Under a load the side of a nearly incompressible square turns before it is half as wide.
    """
    return one_cell(solid, (*SLIDING, Support(edge(0, 1.0), velocity=(stretch - 1, None))), **options)


def uniaxial_error(solid, stretch, **options):
    """Of the stretches under the closed form's load, or of lateral stretch and force of a support, over E."""
    force, lateral = uniaxial(solid, stretch)
    if stretch > 1.0:
        state, wrong = one_cell(solid, SLIDING, [Load(edge(0, 1.0), lambda t: (force * t, 0.0))], **options), 0.0
    else:
        state = compressed(solid, stretch, **options)
        wrong = abs(state.support_force[2, 0] + force) / E
    assert spread(state.F) < 1e-10
    return max(wrong, *np.abs(state.x.max(axis=1) - (stretch, lateral)))


def equibiaxial_error(solid, stretch, **options):
    """Of the forces on four supports and of the Cauchy stress at the points, relative to the largest force.

    Under loads instead of supports a square is unstable long before it is half as wide.
    """
    force = equibiaxial(solid, stretch)
    pulls = [Support(edge(axis, 1.0), velocity=np.where(np.arange(2) == axis, stretch - 1, None)) for axis in (0, 1)]
    state = one_cell(solid, (*SLIDING, *pulls), **options)
    cauchy = np.eye(2)[:, :, None] * force / (1.0 if is_linear(solid) else stretch)
    errors = state.support_force - force * np.array([(1, 0), (0, 1), (-1, 0), (0, -1)]), state.stress - cauchy
    return max(np.abs(error).max() for error in errors) / abs(force)


def confined_error(solid, stretch, **options):
    """Of the forces on three supports, relative to the largest."""
    force, across = confined(solid, stretch)
    pull = Support(edge(0, 1.0), velocity=(stretch - 1, None))
    state = one_cell(solid, (*SLIDING, pull, Support(edge(1, 1.0), velocity=(None, 0.0))), **options)
    expected = np.array([(force, 0), (0, across), (-force, 0), (0, -across)])
    return np.abs(state.support_force - expected).max() / max(abs(force), abs(across), 1e-9 * E)


def shear_error(solid, shear, **options):
    """Of forces on bottom and top, and of the Cauchy stress at the points, relative to mu."""
    held = [Support(edge(1, 0.0)), Support(edge(1, 1.0), velocity=(shear, 0))]
    state = one_cell(solid, held, **options)
    expected, mu = sheared(solid, shear), solid.lame[1]
    forces = np.outer((1, -1), expected[:, 1])
    return max(
        np.abs(state.support_force - forces).max() / mu,
        np.abs(state.stress - expected[:, :, None]).max() / mu,
    )


TESTS = {
    "uniaxial": (uniaxial_error, STRETCHES),
    "equibiaxial": (equibiaxial_error, STRETCHES),
    "confined": (confined_error, STRETCHES),
    "shear": (shear_error, SHEARS),
}


def worst(kind, law, nus=NU, **options):
    error, amounts = TESTS[kind]
    return max(error(law(E, nu, 1000.0), amount, **options) for nu in nus for amount in amounts)


@pytest.mark.parametrize("law", LAWS + RUBBERS)
@pytest.mark.parametrize("kind", TESTS)
def test_one_cell_follows_the_closed_form(kind, law):
    """Stretches from 0.5 to 2, shears to 1.5, nu = 0, 0.3, 0.49; to 1e-9, Newton's tolerance times the slope."""
    assert worst(kind, law) < 1e-9


@pytest.mark.parametrize(
    "options", [{"mean_dilatation": True}, {"linear": linear.amg}], ids=["mean dilatation", "amg"]
)
@pytest.mark.parametrize("kind", TESTS)
def test_the_closed_forms_hold_with_mean_dilatation_and_with_amg(kind, options):
    """Neo-Hookean; the same tolerance, for a uniform deformation knows no cells."""
    scheme = Scheme(inertia=False, newton_tol=1e-12, **options)
    assert worst(kind, NeoHookean, (0.3,), scheme=scheme) < 1e-9


def test_the_load_of_a_wrong_material_is_noticed():
    """1 % of Young's modulus shows as what it is in every one of the three."""
    soft, stiff = NeoHookean(0.99 * E, 0.3, 1000.0), NeoHookean(E, 0.3, 1000.0)
    force, _ = uniaxial(stiff, 1.3)
    state = one_cell(soft, SLIDING, [Load(edge(0, 1.0), lambda t: (force * t, 0.0))])
    assert 1e-3 < state.x[0].max() - 1.3 < 1e-2


# Derivatives.


def consistency(law, n=2000, step=1e-30):
    """Largest errors of the stress against the energy's slope and the tangent against the stress's, by complex step.

    Relative to the largest entry at each point; random anchors and gradients, stretches from 1/3 to 3, nu to 0.499.
    """
    rng, found = np.random.default_rng(1), []
    for nu in (0.0, 0.3, 0.499):
        solid = law(E, nu, 1000.0)
        F, F_anchor = (gradients(rng, n) for _ in range(2))
        s = E * rng.normal(size=(2, 2, n))
        seen = Anchored(solid, F_anchor, s + s.swapaxes(0, 1))
        P, C = np.zeros((2, 2, n)), np.zeros((2, 2, 2, 2, n))
        for i, j in np.ndindex(2, 2):
            moved = F.astype(complex)
            moved[i, j] += 1j * step
            P[i, j] = seen.energy(moved).imag / step
            C[:, :, i, j] = seen.stress(moved).imag / step
        for answer, expected in ((seen.stress(F), P), (seen.tangent(F), C)):
            size = np.abs(expected).reshape(-1, n).max(axis=0)
            found.append((np.abs(answer - expected).reshape(-1, n).max(axis=0) / size).max())
    return max(found[0::2]), max(found[1::2])


def gradients(rng, n):
    """Rotation, stretches, rotation."""
    stretch = np.zeros((2, 2, n))
    stretch[0, 0], stretch[1, 1] = np.exp(rng.uniform(-np.log(3), np.log(3), size=(2, n)))
    return product(product(rotation(rng.uniform(0, 7, n)), stretch), rotation(rng.uniform(0, 7, n)))


def rotation(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


@pytest.mark.parametrize("law", LAWS + RUBBERS)
def test_stress_and_tangent_are_derivatives_to_rounding(law):
    """Of 6,000 random states each, 1e-10 of the largest entry at the point: nothing but cancellation in it."""
    assert max(consistency(law)) < 1e-10


# Objectivity.


def turned(turns, stretch=1.3, scheme=SCHEME):
    """A stretched square whose corners are carried around: errors of stress and forces in the turning frame, over E.

    In the first step it is stretched to the uniaxial closed form, then turned by `turns` [rad], one a step. It lies
    askew in one large cell.
    """
    solid, points, tilt = NeoHookean(E, 0.3, 1000.0), box((-0.5, -0.5), (1, 1), spacing=1 / 3), rotation(0.3)
    force, lateral = uniaxial(solid, stretch)
    expected = np.array([force, 0.0])
    corner = 0.5 * np.array([[-1, 1, 1, -1], [-1, -1, 1, 1]])
    turns = np.append(0.0, turns)

    def carried(X):
        """Velocity of the corner X (in the square's own frame): there and nowhere else at the end of each step."""
        at = [tilt @ X, *(tilt @ rotation(turn) @ (X * (stretch, lateral)) for turn in turns)]
        return lambda t: at[int(t) + 1] - at[int(t)]

    supports = [Support(near(0.9 + tilt @ X), velocity=carried(X)) for X in corner.T]
    body = Body(Points(0.9 + tilt @ points.x, points.volume, points.outline), solid)
    found = []
    for state in simulate(Scene([body], cell=2.0, supports=supports), dt=1.0, until=turns.size, scheme=scheme):
        R = tilt @ rotation(turns[round(state.t) - 1])
        stress = np.einsum("ji,jkp,kl->ilp", R, state.stress, R)
        pull = state.support_force @ R
        found.append(
            (
                np.abs(stress - np.diag((force / lateral, 0.0))[:, :, None]).max() / E,
                np.abs(pull[[0, 3]].sum(axis=0) - expected).max() / E,
                np.abs(pull[[1, 2]].sum(axis=0) + expected).max() / E,
            )
        )
    return np.max(found)


def near(place):
    return lambda x: np.abs(x - place[:, None]).max(axis=0) < 1e-9


TURNS = np.radians(np.arange(45, 361, 45))


@pytest.mark.parametrize("options", [{}, {"mean_dilatation": True}, {"anchor": 0.0}], ids=str)
def test_a_stretched_body_that_is_turned_keeps_its_stress(options):
    """Neo-Hookean, a full turn in steps of 45 degrees: stress and forces turn with it to 1e-10 of E.

    LinearElastic, which is not objective, would see a strain of 1 - cos(45 degrees).
    """
    assert turned(TURNS, scheme=Scheme(inertia=False, newton_tol=1e-12, **options)) < 1e-10


# The table and the figure.


def rows():
    names = {
        "uniaxial": (
            "Uniaxial stress, compressed by a support or under a load",
            "stretches 0.5, 0.8, 1.3, 2",
            "stretches and force",
        ),
        "equibiaxial": (
            "Equibiaxial stretch by supports",
            "stretches 0.5, 0.8, 1.3, 2",
            "forces and stress over the force",
        ),
        "confined": ("Uniaxial strain between supports", "stretches 0.5, 0.8, 1.3, 2", "forces over the largest"),
        "shear": ("Simple shear between supports", "shears 0.1, 0.5, 1.5", "forces and stress over mu"),
    }
    out = [
        Row(
            problem=f"{name}, all laws, {amounts}, nu = {', '.join(map(str, NU))}",
            reference="closed form",
            h="1 cell, 25 points",
            error=numbers([worst(kind, law) for law in LAWS + RUBBERS]) + f" ({NAMES}; {what})",
            rate="-",
            goal="closed form to Newton's tolerance: met",
            test="test_one_cell_follows_the_closed_form",
        )
        for kind, (name, amounts, what) in names.items()
    ]
    out += [
        Row(
            problem=f"{name}: stress and tangent are derivatives",
            reference="complex step of energy and stress",
            h="6,000 random states with anchor stresses",
            error=numbers(consistency(law)) + " (of the largest entry)",
            rate="-",
            goal="rounding: met",
            test="test_stress_and_tangent_are_derivatives_to_rounding",
        )
        for law, name in zip(LAWS + RUBBERS, NAMES.split(", "), strict=True)
    ]
    out.append(
        Row(
            problem="Stretched square carried through a full turn in 8 steps",
            reference="its own stress, turned",
            h="1 cell, 25 points",
            error=numbers([turned(TURNS)]) + " (stress and forces, over E)",
            rate="-",
            goal="objectivity to rounding: met by NeoHookean",
            test="test_a_stretched_body_that_is_turned_keeps_its_stress",
        )
    )
    return out


def figures(folder):
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(7.5, 3.4), layout="constrained")
    stretch, shear = np.linspace(0.5, 2.0, 60), np.linspace(0.0, 1.5, 60)
    for colour, nu in zip(("C0", "C1", "C2"), NU, strict=True):
        solid = NeoHookean(E, nu, 1000.0)
        axes[0].plot(stretch, [uniaxial(solid, a)[0] / E for a in stretch], colour, label=f"nu = {nu}")
        for a in (0.5, 0.6, 0.8):
            axes[0].plot(a, -compressed(solid, a).support_force[2, 0] / E, colour + "o")
        for a in (1.2, 1.5, 1.75, 2.0):
            force, _ = uniaxial(solid, a)
            state = one_cell(solid, SLIDING, [Load(edge(0, 1.0), lambda t, f=force: (f * t, 0.0))])
            axes[0].plot(state.x[0].max(), force / E, colour + "o")
        axes[1].plot(shear, [sheared(solid, g)[0, 1] / E for g in shear], colour)
        for g in (0.25, 0.75, 1.25):
            state = one_cell(solid, [Support(edge(1, 0.0)), Support(edge(1, 1.0), velocity=(g, 0))])
            axes[1].plot(g, -state.support_force[1, 0] / E, colour + "o")
    axes[0].set(xlabel="stretch", ylabel="nominal stress / E", title="uniaxial stress")
    axes[1].set(xlabel="shear", ylabel="force / E", title="simple shear")
    axes[0].legend()
    figure.savefig(folder / "materials.png", dpi=120)
    plt.close(figure)
    return {"materials.png": "Neo-Hookean stress against stretch and shear: closed forms (lines), one cell (dots)."}
