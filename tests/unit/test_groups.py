"""Bodies of several materials: groups of points, what is asked of materials, and errors in them."""

import sys
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest
import skfem
from skfem.io.meshio import to_meshio

import skmpm
from skmpm import LinearElastic, NeoHookean, Rigid
from skmpm.points import Points, box, disc, from_mesh
from skmpm.scene import Body, Load, Scene, SceneError, Support, Wall, mises, stress_zz
from skmpm.scheme import Scheme
from skmpm.simulation import simulate
from skmpm.step.algorithm import step
from skmpm.step.derived import bulk_of
from skmpm.step.initial_state import initial
from skmpm.step.regrid import regridded_state

sys.path.append(str(Path(__file__).parent))
from test_only_what_is_required import Calls

CORE, SHELL = NeoHookean(1e7, 0.3, 2000.0), NeoHookean(1e6, 0.45, 1000.0)
R, CELL, DT = 1e-3, 0.2e-3, 5e-6


def rings(centre=(0.0, 0.0), core=0.5):
    """A disc with a core, as names of the groups."""
    return disc(centre, R, spacing=CELL / 2).with_groups(
        lambda x: np.where(np.hypot(*(x - np.reshape(centre, (2, 1)))) < core * R, "core", "shell")
    )


def halves(points):
    middle = np.median(points.x[0])
    return points.with_groups(lambda x: np.where(x[0] < middle, "left", "right"))


def squeezed(materials, points=None, **options):
    """One disc between two plates that close."""
    points = rings((0.03e-3, 1.001e-3)) if points is None else points
    plates = [Wall((0, 0), (0, 1)), Wall((0, 2.003 * R), (0, -1), velocity=(0, -1.0))]
    return Scene([Body(points, materials)], cell=CELL, walls=plates, friction=0.3, **options)


def run(scene, steps=6, dt=DT, **options):
    *_, state = simulate(scene, dt=dt, until=steps * dt, **options)
    return state


# Groups of points.


def test_groups_are_names_from_a_function_of_positions_or_an_array():
    points = box((0, 0), (2, 1), spacing=0.25)
    by_function = points.with_groups(lambda x: np.where(x[0] < 1, "left", "right"))
    by_array = points.with_groups(np.where(points.x[0] < 1, "left", "right"))
    assert np.array_equal(by_function.group, by_array.group)
    assert points.group is None
    assert by_function.x is not points.x and np.array_equal(by_function.x, points.x)


@pytest.mark.parametrize(
    ("group", "words"),
    [
        (lambda x: x[0] < 1, "bool"),
        (lambda x: "left", "shape ()"),
        (["left", "right"], "shape (2,)"),
        (lambda x: np.arange(x.shape[1]), "int64"),
    ],
)
def test_groups_that_are_not_names_of_the_points_are_refused(group, words):
    points = box((0, 0), (2, 1), spacing=0.25)
    with pytest.raises(ValueError, match="with_groups") as error:
        points.with_groups(group)
    assert words in str(error.value) and "one name per point" in str(error.value)


def test_a_scene_refuses_groups_of_another_length():
    cloud = box((0, 0), (2, 1), spacing=0.25)
    with pytest.raises(SceneError, match=r"body 0: group has shape \(2,\)"):
        Scene([Body(Points(cloud.x, cloud.volume, cloud.outline, np.array(["a", "b"])), SHELL)], cell=0.5)


# Groups of meshes.


def layered(lower="low", upper="high"):
    mesh = skfem.MeshQuad.init_tensor(np.linspace(0, 4, 9), np.linspace(0, 2, 5) ** 1.3)
    height = mesh.p[1, mesh.t].mean(axis=0)
    return mesh, np.where(height < 1.1, lower, upper), height


def areas(points):
    return {name: points.volume[points.group == name].sum() for name in np.unique(points.group).tolist()}


def expected_areas(mesh, group):
    corners = mesh.p[:, mesh.t]
    area = np.ptp(corners[0], axis=0) * np.ptp(corners[1], axis=0)
    return {name: area[group == name].sum() for name in np.unique(group).tolist()}


def kinds_of_meshes():
    mesh, group, _ = layered()
    cells = [("quad", mesh.t.T)]
    tag = np.where(group == "low", 7, 3)
    index = [np.flatnonzero(group == name) for name in ("low", "high")]
    return {
        "gmsh": meshio.Mesh(
            mesh.p.T,
            cells,
            cell_data={"gmsh:physical": [tag]},
            field_data={"low": np.array([7, 2]), "high": np.array([3, 2]), "edge": np.array([7, 1])},
        ),
        "sets": meshio.Mesh(
            mesh.p.T, cells, cell_sets={"low": [index[0]], "high": [index[1]], "all": [np.arange(tag.size)]}
        ),
        "scikit-fem": to_meshio(mesh.with_subdomains({"low": index[0], "high": index[1]})),
        "rest": meshio.Mesh(mesh.p.T, cells, cell_sets={"low": [index[0]]}),
        "unnamed": meshio.Mesh(mesh.p.T, cells, cell_data={"gmsh:physical": [tag]}),
    }


@pytest.mark.parametrize("kind", ["gmsh", "sets", "scikit-fem", "rest", "unnamed"])
def test_groups_of_a_mesh_keep_their_areas(kind):
    mesh, group, _ = layered()
    points = from_mesh(kinds_of_meshes()[kind])
    names = {"rest": ("low", "other"), "unnamed": ("7", "3")}.get(kind, ("low", "high"))
    wanted = expected_areas(mesh, np.where(group == "low", *names))
    assert areas(points) == pytest.approx(wanted, rel=1e-13)


NODES = """*NODE
1, 0., 0.
2, 1., 0.
3, 1., 1.
4, 0., 1.
5, 2., 0.
6, 2., 1.
7, 3., 0.
8, 3., 1.
"""


ONE, TWO, THREE = "1, 1, 2, 3, 4\n", "2, 2, 5, 6, 3\n", "3, 5, 7, 8, 6\n"
PICKED = "*ELSET, ELSET=CORE\n1\n*ELSET, ELSET=SKIN\n2, 3\n"


def of(name=""):
    return f"*ELEMENT, TYPE=CPS4, ELSET={name}\n" if name else "*ELEMENT, TYPE=CPS4\n"


@pytest.mark.parametrize(
    "elements",
    [
        of("CORE") + ONE + of("SKIN") + TWO + THREE,
        of() + ONE + TWO + THREE + PICKED,
        of("ALL") + ONE + TWO + THREE + PICKED,
        "*ELEMENT, TYPE=T3D2, ELSET=Line1\n9, 1, 2\n"
        + (of("Surface1") + ONE + of("Surface2") + TWO + of("Surface3") + THREE + PICKED),
    ],
    ids=["of elements", "of numbers", "within one of all", "gmsh"],
)
def test_sets_of_an_abaqus_file_are_groups(elements, tmp_path):
    """Three squares, one core and two skin."""
    (tmp_path / "mesh.inp").write_text(NODES + elements)
    points = from_mesh(meshio.read(tmp_path / "mesh.inp"))
    assert {name: points.volume[points.group == name].sum() for name in np.unique(points.group)} == pytest.approx(
        {"CORE": 1.0, "SKIN": 2.0}, rel=1e-13
    )


@pytest.mark.parametrize(
    ("elements", "name"),
    [
        (of() + ONE + of("SKIN") + TWO + THREE, "SKIN"),
        (of("A") + ONE + of("B") + TWO + "*ELSET, ELSET=AB\nA, B\n", "AB"),
    ],
)
def test_sets_that_meshio_mixes_up_are_refused(elements, name, tmp_path):
    (tmp_path / "mesh.inp").write_text(NODES + elements)
    with pytest.raises(
        ValueError, match=rf"the set '{name}' has cells that the mesh has not; .* numbers of elements"
    ):
        from_mesh(meshio.read(tmp_path / "mesh.inp"))


def test_a_mesh_of_triangles_and_quadrilaterals_keeps_its_groups():
    mesh, group, _ = layered()
    quads, (a, b, c, d) = mesh.t[:, group == "low"], mesh.t[:, group == "high"]
    triangles = np.concatenate([[a, b, c], [a, c, d]], axis=1)
    blocks = [("triangle", triangles.T), ("line", [[0, 1]]), ("quad", quads.T)]
    tags = [np.full(triangles.shape[1], 5), np.array([1]), np.full(quads.shape[1], 2)]
    points = from_mesh(meshio.Mesh(mesh.p.T, blocks, cell_data={"gmsh:physical": tags}))
    low, high = (expected_areas(mesh, group)[name] for name in ("low", "high"))
    assert areas(points) == pytest.approx({"2": low, "5": high}, rel=1e-13)


def test_no_point_but_those_of_the_outline_lies_on_the_boundary_of_a_mesh_with_groups():
    points = from_mesh(kinds_of_meshes()["gmsh"])
    (x, y), top = points.x, 2**1.3
    on = (np.abs(x * (4 - x)) < 1e-12) | (np.abs(y * (top - y)) < 1e-12)
    assert np.array_equal(np.flatnonzero(on), np.sort(np.concatenate(points.outline)))
    assert points.volume.min() > 0.0


def test_a_mesh_without_groups_has_points_without_groups():
    mesh, _, _ = layered()
    assert from_mesh(meshio.Mesh(mesh.p.T, [("quad", mesh.t.T)])).group is None


# Errors.


@pytest.mark.parametrize(
    ("points", "material", "words"),
    [
        (disc((0, 0), R, spacing=CELL / 2), {"core": CORE}, ("'core'", "have no groups", "with_groups")),
        (rings(), {"core": CORE}, ("group 'shell'", "has no material", "'core'")),
        (rings(), {"core": CORE, "shell": SHELL, "rim": SHELL}, ("group 'rim'", "'core', 'shell'")),
        (rings(), {"core": Rigid(1000.0), "shell": SHELL}, ("group 'core'", "Rigid")),
        (rings(), {"core": NeoHookean(-1.0, 0.3, 1.0), "shell": SHELL}, ("group 'core'", "modulus E")),
        (rings(), {"core": CORE, "shell": replace(SHELL, density=0.0)}, ("group 'shell'", "density")),
        (rings(), {"core": CORE, "shell": "rubber"}, ("group 'shell'", "'rubber'")),
        (rings(), {}, ("has no material",)),
    ],
)
def test_errors_name_body_group_and_remedy(points, material, words):
    with pytest.raises(SceneError, match="body 0") as error:
        Scene([Body(points, material)], cell=CELL)
    for word in words:
        assert word in str(error.value)


# What is asked of materials.


def test_mass_wave_speed_and_compliance_are_those_of_the_parts():
    scene = squeezed({"shell": SHELL, "core": CORE})
    points, group = scene.bodies[0].points, scene.bodies[0].points.group
    mass = np.where(group == "core", 2000.0, 1000.0) * points.volume
    assert np.array_equal(initial(scene).mass, mass)
    assert scene.fastest_wave == pytest.approx(skmpm.material.wave_speed(CORE))
    lam, mu = SHELL.lame  # the shell is what is touched
    assert scene.compliance[0] == pytest.approx((lam + 2 * mu) / (4 * mu * (lam + mu)))
    share = points.volume[group == "core"].sum() / points.volume.sum()
    slowness = share / skmpm.material.wave_speed(CORE) + (1 - share) / skmpm.material.wave_speed(SHELL)
    assert scene.crossing_times[0] == pytest.approx(R * slowness, rel=1e-6)
    assert [type(m) for m in scene.materials] == [NeoHookean, NeoHookean] and scene.composite.all()
    assert "1 of NeoHookean" in repr(scene)


def test_a_spin_is_about_the_centre_of_mass():
    """A box of halves of densities 2000 and 1000: it spins, and its centre of mass stays where it is."""
    body = Body(halves(box((0.0, 0.0), (2 * R, R), spacing=CELL / 2)), {"left": CORE, "right": SHELL}, spin=50.0)
    state = initial(Scene([body], cell=CELL))
    assert np.abs(state.v @ state.mass).max() < 1e-12 * (np.abs(state.v) @ state.mass).max()
    arm = state.x - np.average(state.x, axis=1, weights=state.mass)[:, None]
    momentum = state.mass @ (arm[0] * state.v[1] - arm[1] * state.v[0])
    assert momentum == pytest.approx(50.0 * state.mass @ (arm**2).sum(axis=0), rel=1e-12)


def test_a_driven_wall_has_the_mass_of_the_parts_by_default():
    scene = Scene(squeezed({"core": CORE, "shell": SHELL}).bodies, cell=CELL, walls=[Wall((0, 0), (0, 1), force=1.0)])
    assert scene.wall_masses[0] == pytest.approx(initial(scene).mass.sum())


def test_stress_and_out_of_plane_stress_follow_the_group_of_each_point():
    linear = LinearElastic(1e6, 0.2, 1000.0)
    scene = squeezed({"core": CORE, "shell": linear})
    state = run(scene)
    core = scene.bodies[0].points.group == "core"
    P = CORE.stress(state.F[..., core])
    expected = np.einsum("ijp,kjp->ikp", P, state.F[..., core]) / np.linalg.det(state.F[..., core].T)
    np.testing.assert_allclose(state.stress[..., core], expected, atol=1e-9 * np.abs(expected).max())
    np.testing.assert_allclose(
        state.stress[..., ~core], linear.stress(state.F[..., ~core]), atol=1e-9 * np.abs(expected).max()
    )
    zz = stress_zz(scene, state)
    assert np.array_equal(zz[core], CORE.stress_zz(state.F[..., core]))
    np.testing.assert_allclose(zz[~core], 0.2 * np.trace(state.stress[..., ~core]), rtol=1e-9)
    assert np.isfinite(mises(state.stress, zz)).all()


MIXES = {
    "averaged": (NeoHookean(1e7, 0.45, 2000.0), NeoHookean(1e6, 0.49, 1000.0)),
    "one of two": (NeoHookean(1e7, 0.3, 2000.0), NeoHookean(1e6, 0.49, 1000.0)),
    "linear and not": (LinearElastic(1e7, 0.45, 2000.0), NeoHookean(1e6, 0.49, 1000.0)),
    "pointwise": (LinearElastic(1e7, 0.3, 2000.0), NeoHookean(1e6, 0.2, 1000.0)),
}


@pytest.mark.parametrize("mix", MIXES)
def test_forces_are_derivatives_of_the_energy_where_cells_are_shared(mix):
    """Central differences along random displacements, with a reference configuration that is not at rest."""
    rng, scene = np.random.default_rng(1), squeezed(dict(zip(("core", "shell"), MIXES[mix], strict=True)))
    state = initial(scene)
    n = state.x.shape[1]
    F = np.eye(2)[:, :, None] + 0.05 * rng.normal(size=(2, 2, n))
    state = replace(state, F_anchor=F, stress_anchor=1e4 * np.repeat(np.eye(2)[:, :, None], n, axis=2))
    bulk = bulk_of(scene, replace(state, derived=initial(scene).derived), Scheme())
    assert bulk.mixed_cells
    nodes = bulk.assembly.grid.nodes
    u, d = (size * CELL * rng.normal(size=2 * nodes) for size in (0.02, 1e-5))
    plus, minus = bulk.at(u + d), bulk.at(u - d)
    middle = bulk.at(u)
    assert bulk.force(middle) @ d == pytest.approx(0.5 * (bulk.energy(plus) - bulk.energy(minus)), rel=1e-6)
    K = bulk.assembly.matrix(bulk.stiffness(middle), 1.0, np.zeros((nodes, 2, 2)))
    slope = 0.5 * (bulk.force(plus) - bulk.force(minus))
    np.testing.assert_allclose(K @ d, slope, atol=1e-6 * np.abs(slope).max())


def test_a_translation_keeps_what_was_evaluated_and_changes_neither_energy_nor_forces():
    bulk = bulk_of(
        scene := squeezed(dict(zip(("core", "shell"), MIXES["averaged"], strict=True))), initial(scene), Scheme()
    )
    grid, rng = bulk.assembly.grid, np.random.default_rng(2)
    u = 0.02 * CELL * rng.normal(size=2 * grid.nodes)
    shift = CELL * rng.normal(size=(grid.bodies, 2))[grid.node_body].ravel()
    there = bulk.at(u)
    energy = bulk.energy(there)
    moved, anew = there.translated(u + shift, there.scalars), bulk.at(u + shift)
    assert np.array_equal(moved.displacement, anew.displacement) and np.array_equal(there.displacement, u)
    assert moved.responses is there.responses and bulk.energy(moved) == energy
    assert bulk.energy(anew) == pytest.approx(energy, rel=1e-10)
    np.testing.assert_allclose(bulk.force(moved), bulk.force(anew), atol=1e-10 * np.abs(bulk.force(anew)).max())


def test_the_ghost_penalty_of_a_soft_skin_is_that_of_the_skin():
    """Where its cells hold points of both, too: the penalty of a disc of the skin alone."""
    thin = rings((0.03e-3, 1.001e-3), core=0.97)
    scene, alone = squeezed({"core": replace(CORE, E=1e9), "shell": SHELL}, thin), squeezed(SHELL)
    derived, of_one = initial(scene).derived, initial(alone).derived
    assert derived.ghost.min() == of_one.ghost[0] < derived.ghost.max()
    grid, shell = derived.assembly.grid, thin.group == "shell"
    assert (derived.ghost[grid.cell_of_point[shell]] == of_one.ghost[0]).all()
    np.testing.assert_array_equal(derived.assembly.ghost.data, of_one.assembly.ghost.data)


def test_rings_of_isotropic_materials_are_indifferent_to_rotation_and_other_parts_are_not():
    def indifferent(points):
        materials = {name: CORE if name == "core" else SHELL for name in np.unique(points.group).tolist()}
        return Scene([Body(points, materials)], cell=CELL).indifferent_to_rotation[0]

    centred = disc((0, 0), R, spacing=CELL / 2)
    aside = centred.with_groups(lambda x: np.where(np.hypot(x[0] - 0.2 * R, x[1]) < 0.5 * R, "core", "shell"))
    assert indifferent(rings())
    assert not indifferent(aside)
    assert not indifferent(halves(centred))


def test_preflight_speaks_of_the_parts():
    text = str(skmpm.preflight(squeezed({"core": replace(CORE, E=1.1e11), "shell": SHELL}), DT))
    assert "! body 0: ratio of E 1.1e+05; parts of one body" in text
    assert "ratio of E" not in str(skmpm.preflight(squeezed({"core": replace(CORE, E=1e11), "shell": SHELL}), DT))
    other = Body(disc((2.1e-3, 1.001e-3), R, spacing=CELL / 2), replace(SHELL, E=2e9))
    text = str(
        skmpm.preflight(Scene([Body(rings((0, 1.001e-3)), {"core": CORE, "shell": SHELL}), other], cell=CELL), DT)
    )
    assert "! bodies 0 and 1: ratio of E 2e+03" in text
    text = str(skmpm.preflight(squeezed({"core": LinearElastic(1e7, 0.3, 1e3), "shell": SHELL}), DT))
    assert "LinearElastic" in text and "[small-strain]" in text and "nonlinear, Newton" in text
    text = str(skmpm.preflight(squeezed({"core": CORE, "shell": SHELL}), DT, scheme=Scheme(mean_dilatation=False)))
    assert "! body 0: nu = 0.45 without mean dilatation" in text
    skmpm.suggest(squeezed({"core": CORE, "shell": SHELL}), error=0.1)


# Runs.


def test_equal_materials_of_two_groups_are_one():
    """Bit for bit, mean dilatation included."""
    one, two = (run(squeezed(m)) for m in (SHELL, {"core": SHELL, "shell": replace(SHELL)}))
    for name in ("x", "v", "F", "stress", "wall_force"):
        assert np.array_equal(getattr(one, name), getattr(two, name))


@pytest.mark.parametrize("scheme", [Scheme(), Scheme(anchor=0.05)], ids=["", "regrid"])
def test_a_composite_disc_restarts_bit_for_bit(scheme, tmp_path):
    scene = squeezed({"core": CORE, "shell": SHELL})
    whole = run(scene, scheme=scheme)
    skmpm.save(tmp_path / "half", run(scene, 3, scheme=scheme))
    *_, state = simulate(scene, dt=DT, until=6 * DT, scheme=scheme, start=skmpm.load(tmp_path / "half"))
    for name in ("x", "v", "F", "stress", "wall_force"):
        assert np.array_equal(getattr(whole, name), getattr(state, name))


def test_momentum_and_energy_of_two_composite_discs_that_collide():
    """Momentum to round-off; what is left of the energy is dissipated by backward Euler, never gained."""
    bodies = [
        Body(rings((0.0, 0.0)), {"core": CORE, "shell": SHELL}, velocity=(1.0, 0.2)),
        Body(
            halves(disc((2.05e-3, 0.3e-3), R, spacing=CELL / 2)), {"left": SHELL, "right": CORE}, velocity=(-1.0, 0)
        ),
    ]
    scene = Scene(bodies, cell=CELL, friction=0.4)
    start = initial(scene)
    *_, state = simulate(scene, dt=2e-6, until=2e-4, start=start)
    momentum = [s.v @ s.mass for s in (start, state)]
    np.testing.assert_allclose(*momentum, atol=1e-9 * np.abs(start.mass * start.v).sum())
    energy = state.report.energy
    assert 0.0 < energy.dissipated < 0.5 * (start.mass @ (start.v**2).sum(axis=0))


def test_what_a_linear_run_keeps_belongs_to_the_groups():
    """A state goes on in a scene in which two parts have changed places: as if nothing had been kept."""
    points = halves(box((0, 0), (2 * R, R), spacing=CELL / 2))
    soft, stiff = LinearElastic(1e6, 0.3, 1e3), LinearElastic(1e7, 0.3, 1e3)
    other = points.with_groups(np.where(points.group == "left", "right", "left"))
    options = {
        "cell": CELL,
        "supports": [Support(lambda x: x[0] < 1e-9)],
        "loads": [Load(lambda x: x[0] > 1.999 * R, (1.0, 1.0))],
    }
    scene, swapped = (Scene([Body(p, {"left": soft, "right": stiff})], **options) for p in (points, other))
    scheme = Scheme(ghost=0.0)
    state = run(scene, 2, scheme=scheme)
    assert state.factored is not None
    kept, anew = (step(swapped, s, DT, scheme=scheme) for s in (state, replace(state, derived=None)))
    assert np.array_equal(kept.x, anew.x)


def test_continued_keeps_densities_and_may_change_moduli():
    scene = squeezed({"core": CORE, "shell": SHELL})
    state = run(scene, 2)
    heavy = squeezed({"core": replace(CORE, density=1.0), "shell": SHELL})
    with pytest.raises(SceneError, match="body 0 of the new scene has another density"):
        skmpm.continued(scene, state, heavy)
    softer = squeezed({"core": replace(CORE, E=5e6), "shell": replace(SHELL, E=5e5)})
    start = skmpm.continued(scene, state, softer)
    kept, anew = (step(softer, s, DT) for s in (start, replace(start, derived=None)))
    assert np.array_equal(kept.x, anew.x)
    with pytest.raises(SceneError, match="other masses"):
        step(heavy, state, DT)


# Only what a scene requires.


def test_scenes_of_bodies_of_one_material_each_know_nothing_of_parts_of_cells():
    others = [Body(disc((2.1e-3 * i, 0.0), R, spacing=CELL / 2), m) for i, m in enumerate((CORE, SHELL, CORE))]
    off, on = Scene(others, cell=CELL), squeezed({"core": CORE, "shell": SHELL})
    for scene, mixed in ((off, False), (on, True)):
        state, _ = regridded_state(scene, initial(scene), Scheme())
        bulk_of(scene, state, Scheme())
        with Calls() as calls:
            bulk = bulk_of(scene, state, Scheme())
            bulk.force(bulk.at(state.displacement))
            bulk.force(bulk.at(state.displacement))
        assert bulk.mixed_cells is mixed
        assert (bulk._mean_dilatation_points[2] is None) is not mixed
        assert len(bulk.groups) == 2  # of three bodies
        asked = calls.below("skmpm.scene") - calls.named("State.grids")
        assert asked == 0  # the points of a material are found once for a scene
