r"""With mean dilatation nothing locks up to a Poisson's ratio of 0.49999; without it stresses are several times off.

Problems are Cook's membrane and a disc pressed over two arcs of 60 degrees. The reference of both is the mixed finite
element method of scikit-fem (Taylor & Hood: displacements quadratic, pressure linear), which does not lock, on grids
whose own error is below 1e-3. Loads are small, steps quasi-static, one step for a linear material. Errors are
relative L2 norms over the points, weighted by their volumes.

The goal is missed in the displacement of Cook's membrane on the finest grid. There the singularity of the corner
limits the error, $r^{0.64}$ at 0.3 and $r^{0.54}$ at 0.5. Fitted Q1 elements with mean dilatation have such ratios,
too.

Smoothed aggregation, the multigrid of `amg`, knows nothing of the volumes of cells. At 0.49999, where $\lambda/\mu$
is 5e4, use `banded`.
"""

from functools import cache, partial

import numpy as np
import pytest
import scipy.sparse as sp
from fem import by_neighbours
from ledger import Row, numbers, rate, relative, tabulated, texts
from skfem import (
    Basis,
    BilinearForm,
    CellBasis,
    ElementQuad0,
    ElementQuad1,
    ElementTriP1,
    ElementTriP2,
    ElementVector,
    FacetBasis,
    LinearForm,
    MeshQuad,
    MeshTri,
    condense,
    solve,
)
from skfem.helpers import ddot, div, dot, sym_grad

from skmpm import (
    Body,
    LinearElastic,
    Load,
    NeoHookean,
    Scene,
    Scheme,
    Support,
    box,
    disc,
    initial,
    linear,
    simulate,
    step,
)
from skmpm.material import determinant
from skmpm.points import Points
from skmpm.points.cloud import signed_area
from skmpm.scene import StepFailed

NU = (0.3, 0.45, 0.499, 0.49999)
TESTED = (0.3, 0.499, 0.49999)
E = 1e6  # [Pa]
FORCE = 1e-5 * E  # [N/m] on Cook's membrane, [Pa] on the disc: strains of 1e-5
SOLVERS = {"banded": linear.banded, "amg": linear.amg}
GOAL = "error at 0.49999 at most twice that at 0.3"


# The reference.


class Mixed:
    """Displacements and pressure of an isotropic body under tractions, by Taylor-Hood elements."""

    def __init__(self, mesh, nu, traction, clamped):
        self.lam, self.mu = LinearElastic(E, nu, 1.0).lame
        self.basis = Basis(mesh, ElementVector(ElementTriP2()), intorder=4)
        pressure = self.basis.with_element(ElementTriP1())
        A = BilinearForm(lambda u, v, w: 2 * self.mu * ddot(sym_grad(u), sym_grad(v))).assemble(self.basis)
        B = BilinearForm(lambda u, q, w: div(u) * q).assemble(self.basis, pressure)
        C = BilinearForm(lambda p, q, w: p * q / self.lam).assemble(pressure)
        boundary = FacetBasis(mesh, ElementVector(ElementTriP2()), intorder=6)
        f = LinearForm(lambda v, w: dot(traction(np.asarray(w.x)), v)).assemble(boundary)
        K = sp.block_array([[A, -B.T], [-B, -C]]).tocsr()
        both = solve(*condense(K, np.append(f, np.zeros(pressure.N)), D=clamped(self.basis)))
        self.u, self.p = both[: self.basis.N], both[self.basis.N :]
        self.compliance = f @ self.u  # work of the load [J/m]

    def at(self, x):
        """Displacements (2, n) [m] and stresses (2, 2, n) [Pa] at points x."""
        mesh = self.basis.mesh
        find = mesh.element_finder()
        cells = by_neighbours(lambda part: find(*part), x)
        rule = (mesh.mapping().invF(x[:, :, None], tind=cells), np.ones((cells.size, 1)))

        def values(element, field):
            basis = CellBasis(mesh, element, elements=cells, quadrature=rule, disable_doflocs=True)
            return basis.interpolate(field)

        u, p = values(ElementVector(ElementTriP2()), self.u), values(ElementTriP1(), self.p)
        G = np.asarray(u.grad)[..., 0]
        stress = self.mu * (G + G.swapaxes(0, 1)) - np.asarray(p)[:, 0] * np.eye(2)[:, :, None]
        return np.asarray(u)[..., 0], stress


@cache
def cook_by_fem(nu, n=64):
    """On a grid of 2 n^2 triangles, finer towards the clamped edge and the corners."""
    mesh = MeshTri.init_tensor(np.linspace(0, 1, n + 1) ** 2, 0.5 - 0.5 * np.cos(np.linspace(0, np.pi, n + 1)))
    return Mixed(
        MeshTri(membrane(*mesh.p), mesh.t),
        nu,
        lambda x: np.stack([0 * x[0], np.where(x[0] > 48 - 1e-9, FORCE / 16, 0.0)]),
        lambda basis: basis.get_dofs(lambda x: x[0] < 1e-9).all(),
    )


@cache
def cook_by_fitted_q1(nu, n):
    """Error of the displacement of Q1 elements with mean dilatation that fit the membrane: n x n of them."""
    lam, mu = LinearElastic(E, nu, 1.0).lame
    mesh = MeshQuad.init_tensor(*2 * [np.linspace(0, 1, n + 1)])
    mesh = MeshQuad(membrane(*mesh.p), mesh.t)
    basis = Basis(mesh, ElementVector(ElementQuad1()), intorder=4)
    cells = basis.with_element(ElementQuad0())
    A = BilinearForm(lambda u, v, w: 2 * mu * ddot(sym_grad(u), sym_grad(v))).assemble(basis)
    B = BilinearForm(lambda u, q, w: div(u) * q).assemble(basis, cells)
    area = LinearForm(lambda q, w: q).assemble(cells)
    boundary = FacetBasis(
        mesh, ElementVector(ElementQuad1()), facets=mesh.facets_satisfying(lambda x: x[0] > 48 - 1e-9)
    )
    f = LinearForm(lambda v, w: FORCE / 16 * v[1]).assemble(boundary)
    K = (A + B.T @ sp.diags_array(lam / area) @ B).tocsr()
    u = solve(*condense(K, f, D=basis.get_dofs(lambda x: x[0] < 1e-9).all()))
    exact, _ = cook_by_fem(nu).at(np.asarray(basis.global_coordinates()).reshape(2, -1))
    return relative(np.asarray(basis.interpolate(u)).reshape(2, -1), exact, basis.dx.ravel())


@cache
def disc_by_fem(nu, refinement=5):
    """A polygon of 4 * 2^refinement sides; its centre, and the x of its top, stay."""

    def held(basis):
        r, top = np.hypot(*basis.doflocs), np.abs(basis.doflocs - np.array([[0.0], [1.0]])).max(axis=0) < 1e-9
        return np.append(np.flatnonzero(r < 1e-9), np.flatnonzero(top)[0])

    return Mixed(MeshTri.init_circle(refinement), nu, pressed, held)


def membrane(s, t):
    """Cook's membrane from the unit square: 48 wide, 44 high on the left and 16 on the right [m]."""
    return np.stack([48 * s, 44 * s + t * (44 - 28 * s)])


def pressed(x):
    """Traction on the unit circle: a pressure 1 - (angle / 30 degrees)^2 around top and bottom [Pa]."""
    angle = np.arctan2(np.abs(x[0]), np.abs(x[1])) / (np.pi / 6)
    return -FORCE * np.where(angle < 1, 1 - angle**2, 0.0) * x / np.hypot(*x)


# The same with material points.


def cook_scene(material, cell, per):
    """The membrane on a grid that fits its left edge only: `per` points per cell and direction."""
    square = box((0, 0), (1, 1), spacing=cell / (48 * per))
    s, t = square.x
    points = Points(membrane(s, t), square.volume * 48 * (44 - 28 * s), square.outline)
    supports = [Support(lambda x: x[0] < 1e-9)]
    loads = [Load(lambda x: x[0] > 48 - 1e-9, (0.0, FORCE))]
    return Scene([Body(points, material)], cell=cell, supports=supports, loads=loads)


def disc_scene(material, cell, per):
    """A unit disc, off the lines of the grid, one load for every loaded point of its boundary; nothing holds it."""
    centre = cell * np.array([[0.13], [0.29]])
    points = disc(centre[:, 0], 1.0, spacing=cell / per)
    boundary = points.x[:, points.outline[0]]
    force = pressed(boundary - centre) * 2 * np.pi / boundary.shape[1]
    force -= force.mean(axis=1, keepdims=True)
    loads = [Load(at(x), f) for x, f in zip(boundary.T, force.T, strict=True) if f.any()]
    return Scene([Body(points, material)], cell=cell, loads=loads)


def at(place):
    return lambda x: np.abs(x - place[:, None]).max(axis=0) < 1e-9


PROBLEMS = {"cook": (cook_scene, cook_by_fem), "disc": (disc_scene, disc_by_fem)}


@cache
def measure(problem, nu, cell, *, per=3, law=LinearElastic, **scheme):
    """Relative errors of displacement and stress, and the state."""
    scene = PROBLEMS[problem][0](law(E, nu, 1000.0), cell, per)
    chosen = Scheme(inertia=False, **scheme)
    state = step(scene, initial(scene, scheme=chosen), 1.0, scheme=chosen)
    u, exact, stress, V = compared(problem, nu, state)
    return relative(u, exact, V), relative(state.stress, stress, V), state


def compared(problem, nu, state):
    """Displacements of the points and those of the reference, its stress there, and their undeformed volumes."""
    X, V = state.x_anchor, state.mass / 1000.0
    middle = (X @ V / V.sum())[:, None]
    exact, stress = PROBLEMS[problem][1](nu).at((X - middle) * (1 - 4e-4) + (middle if problem == "cook" else 0.0))
    u = state.x - X
    if problem == "disc":
        u, exact = (without_rigid_motion(field, X - middle, V) for field in (u, exact))
    return u, exact, stress, V


def without_rigid_motion(u, arm, V):
    """A field less its mean translation and rotation."""
    u = u - (u @ V / V.sum())[:, None]
    turn = np.stack([-arm[1], arm[0]])
    return u - turn * np.sum(V * u * turn) / np.sum(V * turn**2)


def iterations(problem, nu, cell):
    """Of conjugate gradients with `linear.amg` for the one solve of a step; None where they do not converge."""
    counts = []
    try:
        measure(problem, nu, cell, mean_dilatation=True, linear=partial(linear.amg, callback=counts.append))
    except StepFailed:
        return None
    return counts[-1]


# Tests.


@pytest.mark.parametrize("problem", PROBLEMS)
@pytest.mark.parametrize("nu", [0.3, 0.49999])
def test_the_reference_has_converged(problem, nu):
    """Work of the load on the grid used and on one with a quarter of the cells: 2e-3, of which a third remains."""
    fine, coarse = (PROBLEMS[problem][1](nu, size) for size in {"cook": (64, 32), "disc": (5, 4)}[problem])
    assert coarse.compliance == pytest.approx(fine.compliance, rel=2e-3)


@pytest.mark.parametrize("cell", [6.0, 3.0])
def test_cooks_membrane_locks_without_the_cure_and_not_with_it(cell):
    """Goal: error at nu = 0.49999 no more than 2 x that at 0.3, of displacement and of stress: 2.0 is asserted.

    8 and 16 cells across. Finer grids miss it in the displacement (2.6 at 32 cells) because the singularity of the
    upper clamped corner, r^0.64 at nu = 0.3, is r^0.54 at 0.5 (Williams' equation): the rate falls with nu for every
    uniform grid. Fitted Q1 elements with the same cure have the same error (the test below).
    """
    u, stress = zip(*(measure("cook", nu, cell, mean_dilatation=True)[:2] for nu in TESTED), strict=True)
    assert max(u) < 2.0 * u[0] and max(stress) < 2.0 * stress[0]
    assert u[-1] < {6.0: 0.065, 3.0: 0.028}[cell]
    assert (
        measure("cook", 0.49999, cell, mean_dilatation=False)[0] > 0.5
    )  # half of the displacement is missing without the cure


def test_the_membrane_is_as_good_as_fitted_elements_with_the_same_cure():
    """Displacement at nu = 0.49999: within 20 % of the error of as many Q1 elements that fit the membrane."""
    for cell, n in ((6.0, 8), (3.0, 16)):
        assert measure("cook", 0.49999, cell, mean_dilatation=True)[0] < 1.2 * cook_by_fitted_q1(0.49999, n)


@pytest.mark.parametrize("cell", [1 / 4, 1 / 8])
def test_a_compressed_disc_locks_without_the_cure_and_not_with_it(cell):
    """Goal: error at nu = 0.49999 no more than 2 x that at 0.3; smooth as it is, 1.3 is asserted on every grid.

    Its boundary cuts cells of every size, some of them with a single point.
    """
    u, stress = zip(*(measure("disc", nu, cell, mean_dilatation=True)[:2] for nu in TESTED), strict=True)
    assert max(u) < 1.3 * u[0] and max(stress) < 1.3 * stress[0]
    assert u[-1] < {1 / 4: 0.04, 1 / 8: 0.011}[cell]
    assert measure("disc", 0.49999, cell, mean_dilatation=False)[0] > 0.3


@pytest.mark.parametrize("nu", [0.3, 0.49999])
def test_neo_hookean_at_small_load_is_linear_elastic(nu):
    """Cook's membrane at strains of 1e-4: displacements to 1e-3, the order of the strain times the aspect ratio."""
    small, finite = (
        measure("cook", nu, 6.0, law=law, mean_dilatation=True)[2] for law in (LinearElastic, NeoHookean)
    )
    u, v = (state.x - small.x_anchor for state in (small, finite))
    assert np.abs(v - u).max() < 1e-3 * np.abs(u).max()
    assert relative(finite.stress, small.stress, small.volume) < 1e-3


def test_neo_hookean_does_not_lock():
    """Goal: error at nu = 0.49999 no more than 2 x that at 0.3."""
    (u, stress, _), (v, other, _) = (
        measure("cook", nu, 6.0, law=NeoHookean, mean_dilatation=True) for nu in (0.3, 0.49999)
    )
    assert v < 2.0 * u and other < 2.0 * stress


@pytest.mark.parametrize("problem", PROBLEMS)
def test_amg_gives_the_same_answer_up_to_a_poissons_ratio_of_0_499(problem):
    """Strain and stress to 1e-6: its tolerance of 1e-10 times the condition of the matrix.

    At 0.49999 it needs 400 iterations and more and `linear.banded` is the solver to take.
    """
    cell = {"cook": 6.0, "disc": 1 / 4}[problem]
    for nu in (0.3, 0.499):
        first, second = (
            measure(problem, nu, cell, mean_dilatation=True, linear=solver)[2] for solver in SOLVERS.values()
        )
        strain, other = (state.F + state.F.swapaxes(0, 1) - 2 * np.eye(2)[:, :, None] for state in (first, second))
        assert relative(other, strain, first.volume) < 1e-6
        assert relative(second.stress, first.stress, first.volume) < 1e-6
    assert iterations(problem, 0.3, cell) < 30
    assert iterations(problem, 0.499, cell) < 200


def test_large_compression_of_a_nearly_incompressible_disc_keeps_its_area():
    """Squeezed by a quarter between two held caps at nu = 0.499: area by outline kept to 0.5 %, and points upright.

    lambda/mu = 499: at a mean pressure of about mu the area may change by 0.2 %.
    """
    points = disc((0.016, 0.036), 1.0, spacing=1 / 12)
    caps = [(lambda x: x[1] > 0.9, -0.25), (lambda x: x[1] < -0.83, 0.25)]
    supports = [Support(where, velocity=(0.0, v)) for where, v in caps]
    scene = Scene([Body(points, NeoHookean(E, 0.499, 1000.0))], cell=1 / 4, supports=supports)
    *_, state = simulate(scene, dt=0.125, until=1.0, scheme=Scheme(inertia=False, mean_dilatation=True))
    boundary = points.outline[0]
    before, after = (signed_area(x[:, boundary]) for x in (points.x, state.x))
    assert after == pytest.approx(before, rel=5e-3)
    assert determinant(state.F).min() > 0.2


# The table and the figures.


def rows():
    out = []
    test = {"cook": "test_cooks_membrane_locks_without_the_cure_and_not_with_it"}
    test["disc"] = "test_a_compressed_disc_locks_without_the_cure_and_not_with_it"
    names = {"cook": "Cook's membrane", "disc": "pressed disc"}
    grids = {"cook": (6.0, 3.0, 1.5), "disc": (1 / 4, 1 / 8, 1 / 16)}
    h = {"cook": ("1/8", "1/16", "1/32"), "disc": ("R/4", "R/8", "R/16")}
    for problem, cells in grids.items():
        for locking in (False, True):
            found = np.array([[measure(problem, nu, c, mean_dilatation=locking)[:2] for nu in NU] for c in cells])
            ratio = found[:, -1] / found[:, 0]
            lines = {f"nu = {nu}": texts(found[:, i].T.ravel()) for i, nu in enumerate(NU)}
            goal = "-"
            if locking:
                lines["0.49999 over 0.3"] = texts(ratio.T.ravel(), 3)
                goal = f"{GOAL}: met"
                if ratio.max() > 2:
                    lines["0.49999 over 0.3, fitted Q1"] = [*texts(fitted_ratios()), *("-",) * len(cells)]
                    goal = f"{GOAL}: missed: in u on the finest grid, by the singularity of the corner"
            out.append(
                Row(
                    problem=f"{names[problem]}, {'with' if locking else 'without'} mean dilatation",
                    reference="scikit-fem, Taylor-Hood, 8,192 and 4,096 triangles",
                    h="relative L2 by the size of cells" + (" over the width" if problem == "cook" else ""),
                    error=tabulated([f"{name}, {size}" for name in ("u", "stress") for size in h[problem]], lines),
                    rate=numbers([rate(cells, found[:, i, 0]) for i in (0, -1)], 3) + " (u at 0.3 and 0.49999)",
                    goal=goal,
                    test=test[problem],
                )
            )
    counts = {problem: [iterations(problem, nu, cells[1]) for nu in NU] for problem, cells in grids.items()}
    lines = {names[p]: ["over 500" if n is None else str(n) for n in c] for p, c in counts.items()}
    out.append(
        Row(
            problem="iterations of amg, with mean dilatation",
            reference="-",
            h="cells of 1/16 of the width and R/8, to 1e-10",
            error=tabulated([f"nu = {nu}" for nu in NU], lines),
            rate="-",
            goal="same answer as banded up to nu = 0.499: met",
            test="test_amg_gives_the_same_answer_up_to_a_poissons_ratio_of_0_499",
        )
    )
    return out


def fitted_ratios():
    """Error of fitted elements at 0.49999 over that at 0.3, on the grids of the table."""
    return [cook_by_fitted_q1(0.49999, n) / cook_by_fitted_q1(0.3, n) for n in (8, 16, 32)]


def figures(folder):
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    nu = 0.5 - np.geomspace(0.2, 1e-5, 9)
    figure, axes = plt.subplots(1, 2, figsize=(7.5, 3.6), sharey=True, layout="constrained")
    for axis, problem, cell in zip(axes, PROBLEMS, (3.0, 1 / 8), strict=True):
        for locking, style in ((False, "o--"), (True, "s-")):
            found = np.array([measure(problem, v, cell, mean_dilatation=locking)[:2] for v in nu])
            kind = "mean dilatation" if locking else "standard"
            axis.loglog(0.5 - nu, found[:, 0], style, color="C0", label=f"displacement, {kind}")
            axis.loglog(0.5 - nu, found[:, 1], style, color="C1", label=f"stress, {kind}")
        axis.invert_xaxis()
        axis.set(xlabel="0.5 - nu", title={"cook": "Cook's membrane, h = width/16", "disc": "disc, R/h = 8"}[problem])
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("relative L2 error")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncol=4, fontsize=7)
    figure.savefig(folder / "locking.png", dpi=120)

    colours = plt.get_cmap("coolwarm", 12)
    figure, axes = plt.subplots(1, 2, figsize=(7.5, 3.6), layout="constrained")
    for axis, locking in zip(axes, (False, True), strict=True):
        state = measure("disc", 0.49999, 1 / 6, mean_dilatation=locking)[2]
        pressure = -(state.stress[0, 0] + state.stress[1, 1]) / 2 / FORCE
        dots = axis.scatter(*state.x, c=pressure, s=14, marker="s", lw=0, cmap=colours, vmin=-1.2, vmax=1.2)
        title = "mean dilatation" if locking else f"standard: from {pressure.min():.0f} to {pressure.max():.0f}"
        axis.set(aspect="equal", title=title, xticks=[], yticks=[])
    figure.colorbar(dots, ax=axes, label="pressure / peak of the load", shrink=0.8)
    with plt.rc_context({"lines.antialiased": False, "patch.antialiased": False}):
        figure.savefig(folder / "locking_pressure.png", dpi=90)
    plt.close("all")
    return {
        "locking.png": "Error against Poisson's ratio for Cook's membrane and a compressed disc: standard"
        " elements lock, mean dilatation does not.",
        "locking_pressure.png": "Pressure at the points of the disc at nu = 0.49999, in units of the load's peak.",
    }
