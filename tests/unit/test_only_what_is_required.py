"""Features that a scene does not use cost nothing, in calls, unknowns, matrix entries and solves.

A profiler counts every call of a Python function of the library, wherever it was looked up. Each promise is kept in
both directions, so that a renamed function cannot keep it: off it is never called, on it is. What is promised
elsewhere is not repeated here; `examples/studies/feature_cost/scenes.py` names the test of every promise.
"""

import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from skmpm import linear
from skmpm.contact import shared_grid
from skmpm.grid import loops as assembly_loops
from skmpm.material import ElastoPlastic, LinearElastic, NeoHookean, Rigid
from skmpm.points import Points, box, disc
from skmpm.scene import Body, Load, Scene, Support, Wall
from skmpm.scheme import Scheme
from skmpm.simulation import simulate
from skmpm.step.algorithm import step
from skmpm.step.initial_state import initial

sys.path.append(str(Path(__file__).parents[1] / "verification"))
from self_contact import rectilinear

SOFT, LINEAR = NeoHookean(1e6, 0.3, 1000.0), LinearElastic(1e6, 0.3, 1000.0)
METAL = ElastoPlastic(1e6, 0.3, 1000.0, yield_stress=1e2)
R, CELL, DT, STEPS = 1e-3, 0.25e-3, 5e-6, 4


class Calls(Counter):
    """How often functions of the library are called while it is entered, by module and qualified name."""

    def __enter__(self):
        self._before = sys.getprofile()
        sys.setprofile(self._note)
        return self

    def __exit__(self, *error):
        sys.setprofile(self._before)

    def _note(self, frame, event, argument):
        module = frame.f_globals.get("__name__", "")
        if event == "call" and module.startswith("skmpm."):
            self[f"{module}.{frame.f_code.co_qualname}"] += 1

    def below(self, *packages):
        """Calls of all that is in these packages."""
        return sum(count for name, count in self.items() if name.startswith(tuple(f"{p}." for p in packages)))

    def named(self, end):
        """Calls of functions whose names, with those of what they are in, end so."""
        return sum(count for name, count in self.items() if name.endswith(f".{end}"))


def round_body(material=SOFT, centre=(0.31e-4, 0.17e-4), **motion):
    return Body(disc(centre, R, spacing=CELL / 2), material, **motion)


def swinging(material=SOFT):
    return round_body(material, velocity=lambda x: 1e3 * np.array([[1.0], [-1.0]]) * x)


def alone(material=SOFT, **options):
    return Scene([swinging(material)], cell=CELL, **options)


def squeezed(material=SOFT, **options):
    walls = [Wall((0, 1.017e-3), (0, -1), velocity=(0, -1.0)), Wall((0, -0.983e-3), (0, 1))]
    return Scene([round_body(material)], cell=CELL, walls=walls, **options)


def run(scene, scheme=Scheme(), steps=STEPS, warn=False):  # noqa: B008
    """Calls of a whole run, and its states; the warnings before it look at what steps may not need."""
    with Calls() as calls:
        states = list(simulate(scene, dt=DT, until=steps * DT, scheme=scheme, warn=warn))
    assert len(states) == steps
    return calls, states


def test_warnings_are_looked_for_once_in_a_run_and_not_where_nobody_wants_them():
    calls = [run(squeezed(), steps=steps, warn=True)[0].below("skmpm.preflight") for steps in (2, 6)]
    assert 0 < calls[0] == calls[1]
    assert run(squeezed())[0].below("skmpm.preflight") == 0


# --- contact


@pytest.mark.parametrize("material", [SOFT, LINEAR], ids=["soft", "linear"])
@pytest.mark.parametrize(
    "scheme", [Scheme(), Scheme(anchor=0.0), Scheme.nezamabadi2017()], ids=["total", "updated", "nezamabadi2017"]
)
def test_one_body_without_walls_runs_no_function_of_contact_and_coulomb(material, scheme):
    """No function at all, nor those that look for overlaps; a wall brings all of them."""
    calls, _ = run(alone(material), scheme)
    assert calls.below("skmpm.contact", "skmpm.coulomb", "skmpm.outline.overlaps", "skmpm.linear.delassus") == 0
    calls, _ = run(squeezed(material), scheme)
    assert calls.below("skmpm.contact") > 0
    assert calls.below("skmpm.coulomb") > 0
    assert calls.below("skmpm.linear.delassus") > 0


def fork(slot):
    """A body of two arms, 0.75 cells thick and 2 long, over a slot of so many half cells."""
    x = [0, 8, 8, 2, 2, 8, 8, 0]
    y = [0, 0, 3, 3, 3 + slot, 3 + slot, 6 + slot, 6 + slot]
    return rectilinear(np.stack([x, y], axis=1), CELL / 2)


def test_only_bodies_that_turn_back_are_searched_for_parts_that_face_each_other():
    """Squeezed discs never; a fork alone has a contact problem only if its arms are near enough to meet in a step."""
    squeezed_pair = Scene(
        [round_body(), round_body(centre=(0.31e-4, 2.018e-3))],
        cell=CELL,
        walls=[Wall((0, -0.983e-3), (0, 1)), Wall((0, 3.0181e-3), (0, -1), velocity=(0, -1.0))],
    )
    calls, states = run(squeezed_pair)
    assert states[-1].contacts.force[0].max() > 0.0
    assert calls["skmpm.outline.near.facing"] == 0
    for slot, near in ((3, True), (6, False)):
        calls, _ = run(Scene([Body(fork(slot), SOFT)], cell=CELL))
        assert calls["skmpm.outline.near.facing"] > 0
        assert (calls.named("boundary.point_to_curve") > 0) == near
        assert calls.below("skmpm.coulomb") == 0


def test_a_wall_out_of_reach_brings_no_compliance_and_no_solve_more_than_convergence_needs():
    """One solve an iteration, as without the wall; a body on a wall needs two, and a Delassus operator."""
    far, near = alone(walls=[Wall((0, -5 * R), (0, 1))]), squeezed()
    for scene, solves in ((alone(), 1), (far, 1), (near, 2)):
        calls, states = run(scene)
        newton = sum(state.report.newton for state in states)
        assert calls["skmpm.linear.band.Banded.__call__"] >= solves * newton
        assert (calls["skmpm.linear.band.Banded.__call__"] == newton) == (solves == 1)
        assert (calls["skmpm.linear.band.Banded.delassus"] > 0) == (solves == 2)
        assert (calls.below("skmpm.coulomb") > 0) == (solves == 2)


def test_bodies_out_of_each_others_reach_are_not_projected_on_one_another():
    """A disc on a wall, alone or with another far away, against one with another beside it."""
    walls = [Wall((0, -0.983e-3), (0, 1))]
    for others, near in (
        ([], False),
        ([round_body(centre=(9 * R, 0.17e-4))], False),
        ([round_body(centre=(2.04 * R, 0.17e-4))], True),
    ):
        calls, states = run(Scene([round_body(), *others], cell=CELL, walls=walls, gravity=(0.0, -9.81)))
        assert (calls.named("gap_function.contacts_between_bodies") > 0) == near
        assert calls.named("gap_function.contacts_with_walls") > STEPS
        assert (states[-1].contacts.bodies[1] == -1).any()


def test_every_configuration_is_evaluated_once():
    """The initial guess and the trial of every iteration; the end of a step is the last, the next start that end."""
    calls, states = run(alone())
    iterations = sum(state.report.newton for state in states)
    assert calls.named("Bulk.energy") > 2 * (STEPS + iterations)
    assert calls.named("Bulk.energy_anew") == calls.named("Bulk.responses") == 1 + STEPS + iterations


def test_pressed_bodies_are_factorised_once_a_matrix():
    """Their rotation is unstable in long steps, as its quadratic form tells before a factorisation fails."""
    lid = [Wall((0, 1.017e-3), (0, -1), velocity=(0, -1e-3)), Wall((0, -0.983e-3), (0, 1))]
    scene = Scene([round_body()], cell=CELL, walls=lid, friction=0.5)
    with Calls() as calls:
        states = list(simulate(scene, dt=1e-2, until=0.1))
    assert calls.named("without_added_mass") > 0
    assert calls.named("matrix._solver") == sum(state.report.factorisations for state in states)


def test_walls_of_rigid_points_have_no_unknowns_and_touch_no_other_wall():
    """A disc squeezed between planes and between slabs of points: the same matrices; two slabs lie on one another."""
    planes = squeezed()
    slabs = [
        Body(box((-2 * R, 1.017e-3), (4 * R, R / 2), spacing=CELL / 2), Rigid(1.0), motion=(0, -1.0, 0.0)),
        Body(box((-2 * R, -0.983e-3 - R / 2), (4 * R, R / 2), spacing=CELL / 2), Rigid(1.0), motion=(0.0, 0.0, 0.0)),
        Body(box((-2 * R, -0.983e-3 - R), (4 * R, R / 2), spacing=CELL / 2), Rigid(1.0), motion=(0.0, 0.0, 0.0)),
    ]
    bodies = Scene([round_body(), *slabs], cell=CELL)
    shapes = []
    for scene in (planes, bodies):
        seen = []

        def seeing(A, blocks, motions, seen=seen):
            seen.append((A.shape, A.nnz))
            return linear.banded(A, blocks, motions)

        calls, states = run(scene, Scheme(linear=seeing))
        assert calls["skmpm.coulomb.search.solve"] > 0
        assert states[-1].contacts.force[0].max() > 0.0
        contact = np.concatenate([state.contacts.bodies for state in states], axis=1)
        assert (contact == 0).any(axis=0).all()
        shapes.append(set(seen))
    assert shapes[0] == shapes[1]
    assert len(shapes[0]) == 1


# --- material


@pytest.mark.parametrize("build", [alone, squeezed], ids=["alone", "in contact"])
def test_a_linear_material_makes_one_tangent_and_searches_no_line(build):
    """In a whole run; at finite strain a tangent for each matrix, and line searches."""
    calls, states = run(build(LINEAR))
    names = ("skmpm.step.bulk.Bulk.stiffness", "skmpm.grid.assembly.Assembly.matrix")
    assert [calls[name] for name in names] == [1, 1]
    assert sum(state.report.factorisations for state in states) == 1
    assert calls["skmpm.step.line_search.search"] == 0
    calls, states = run(build(SOFT))
    matrices = sum(state.report.factorisations for state in states)
    assert [calls[name] for name in names] == [matrices, matrices]
    assert matrices >= STEPS
    assert calls["skmpm.step.line_search.search"] > 0


def test_a_linear_material_computes_its_delassus_operator_once():
    """In a whole run, all the boundary, though contacts spread; at finite strain as often as matrices are new."""
    for material, once in ((LINEAR, True), (SOFT, False)):
        calls, states = run(squeezed(material), steps=20)
        assert np.unique(states[-1].contacts.point).size > np.unique(states[0].contacts.point).size > 0
        assert (calls["skmpm.linear.band.Banded.delassus"] == 1) == once
        assert calls.named("Delassus.between") >= STEPS


@pytest.mark.parametrize("scheme", [Scheme.nezamabadi2017(), Scheme(anchor=0.0)], ids=["shared nodes", "outlines"])
def test_with_regridding_only_points_in_contact_enter_the_delassus_operator(scheme):
    """The next step has another matrix. Points: all nodes with shared grids, all boundary points with outlines."""
    _, states = run(squeezed(LINEAR), scheme)
    known = states[-1].factored.points
    assert 0 < known.sum() < 0.5 * known.size


@pytest.mark.parametrize("build", [alone, squeezed], ids=["alone", "in contact"])
def test_the_potential_of_a_linear_material_is_never_evaluated(build):
    """Its energies are those of the report, two a step; at finite strain line searches and the start ask for more."""
    energies = ("skmpm.step.equations.Increment.energy", "skmpm.step.bulk.Bulk.energy")
    calls, _ = run(build(LINEAR))
    assert [calls[name] for name in energies] == [0, 2 * STEPS]
    calls, _ = run(build(SOFT))
    assert calls[energies[0]] >= 2 * STEPS


@pytest.mark.parametrize("material", [SOFT, LINEAR], ids=["soft", "linear"])
@pytest.mark.parametrize("build", [alone, squeezed], ids=["alone", "in contact"])
def test_without_viscosity_no_function_of_it_runs(build, material):
    """In a whole run, and no matrix and no energy is evaluated more often; with it some are."""
    viscous = ("skmpm.material.viscous", "skmpm.step.forces")
    calls, states = run(build(material))
    assert calls.below(*viscous) == 0
    assert states[-1].report.energy.viscous == 0.0
    calls, states = run(build(replace(material, viscosity=1.0)))
    assert calls.below(*viscous) > STEPS
    assert states[-1].report.energy.viscous > 0.0


@pytest.mark.parametrize("material", [SOFT, LINEAR], ids=["soft", "linear"])
@pytest.mark.parametrize("build", [alone, squeezed], ids=["alone", "in contact"])
def test_without_memory_no_function_of_it_runs_and_no_variable_is_kept(build, material):
    """No function of a material in a step runs, no point has internal variables; with memory they are updated."""
    bound = (
        "InStep.update",
        "InStep.dissipated",
        "InStep.energy",
        "internal_variables._with_memory",
        "_arguments",
    )
    calls, states = run(build(material))
    assert sum(map(calls.named, bound)) == 0
    assert states[-1].internal.size == 0
    assert states[-1].report.energy.plastic == 0.0
    calls, states = run(build(METAL))
    assert calls.named("InStep.update") == STEPS
    assert states[-1].internal[0].max() > 0.0
    assert states[-1].report.energy.plastic > 0.0


# --- body grids

REGRIDDING_CALLS = (
    "skmpm.grid.building.build_grids",
    "skmpm.grid.moment_fitting.fitted_weights",
    "skmpm.outline.cells.cell_moments",
    "skmpm.grid.assembly.prepare",
    "skmpm.grid.assembly.ghost_facets",
    "skmpm.grid.body_grids.BodyGrids.interpolation",
    "skmpm.grid.body_grids.BodyGrids.derivatives",
)


@pytest.mark.parametrize("build", [alone, squeezed], ids=["alone", "in contact"])
def test_without_regridding_grids_are_built_fitted_and_numbered_once_in_a_run(build):
    """At every step with anchor = 0, and with a bound as often as it is passed."""
    calls, states = run(build())
    assert {calls[name] for name in REGRIDDING_CALLS} == {1}
    assert len({id(state.derived.assembly) for state in states}) == 1
    calls, _ = run(build(), Scheme(anchor=0.0))
    assert {calls[name] for name in REGRIDDING_CALLS} == {STEPS}
    calls, states = run(build(), Scheme(anchor=0.02), steps=10)
    times = len({id(state.derived.assembly) for state in states})
    assert 1 < times < 10
    assert {calls[name] for name in REGRIDDING_CALLS} == {times}


def test_without_fitting_no_cell_is_cut_by_an_outline():
    """Nor with it where bodies have no outline."""
    bare = Points(*(getattr(round_body().points, name) for name in ("x", "volume")))
    at_nodes = Scheme(anchor=0.0, contact=shared_grid)
    without = Scene([Body(bare, SOFT)], cell=CELL)
    for scene, scheme in (
        (alone(), Scheme(moment_fitting=False)),
        (alone(), Scheme.nezamabadi2017()),
        (without, at_nodes),
    ):
        calls, _ = run(scene, scheme)
        assert calls["skmpm.grid.moment_fitting.fitted_weights"] == calls["skmpm.outline.cells.cell_moments"] == 0
        assert calls["skmpm.grid.building.build_grids"] > 0
    calls, _ = run(alone(), at_nodes)
    assert calls["skmpm.grid.moment_fitting.fitted_weights"] == calls["skmpm.outline.cells.cell_moments"] == STEPS


def test_ghost_0_leaves_no_entry_in_the_matrix_that_the_cells_do_not_make():
    """Blocks of A: all pairs of nodes that share a cell; the penalty's facets bring pairs across two cells."""
    off, on = (initial(alone(), scheme=Scheme(ghost=ghost)).derived.assembly for ghost in (0.0, 0.005))
    corners = off.grid.nodes_of_cell
    pairs = {(int(a), int(b)) for cell in corners.T for a in cell for b in cell}
    assert off.indices.size == len(pairs)
    assert not off.ghost.data.any()
    assert on.indices.size > 1.1 * len(pairs)
    assert on.ghost.data.any()


def test_ghost_0_sums_no_force_and_no_energy(monkeypatch):
    """With it some; without it neither loop is called."""
    called = []
    for name in ("ghost_force", "ghost_energy"):
        loop = getattr(assembly_loops, name)
        monkeypatch.setattr(
            assembly_loops, name, lambda *args, _name=name, _loop=loop: called.append(_name) or _loop(*args)
        )
    run(alone(), Scheme(ghost=0.0))
    assert not called
    run(alone())
    assert set(called) == {"ghost_force", "ghost_energy"} and len(called) > STEPS
    own = initial(alone()).derived.assembly
    assert np.count_nonzero(own.ghost.data) == own.ghost.nnz < own.indices.size


ONCE = ("outlines", "initial_positions", "initial_volumes", "deformable", "offsets", "normals", "supported", "loaded")
ONCE += ("free_components", "supporting")


def test_what_follows_from_the_scene_alone_is_found_once():
    """In a run from the beginning, however many steps it has."""
    with Calls() as calls:
        scene = squeezed(supports=[Support(left)], loads=[Load(right, pulled)])
        list(simulate(scene, dt=DT, until=STEPS * DT))
    found = {name: calls.named(f"Layout.{name}") + calls.named(f"Model.{name}") for name in ONCE}
    assert found == dict.fromkeys(ONCE, 1)


# --- what acts on bodies


def left(x):
    return x[0] < -0.9 * R


def right(x):
    return x[0] > 0.9 * R


def pulled(t):
    return 1e6 * t, 0.0


@pytest.mark.parametrize(
    "option, names",
    [
        ({"loads": [Load(right, pulled)]}, ("point_sets.points_with_shares",)),
        (
            {"supports": [Support(left)]},
            ("point_sets.supported_points", "Elimination.factorised", "Supported.__call__"),
        ),
    ],
    ids=["loads", "supports"],
)
def test_without_loads_and_supports_no_point_set_is_found(option, names):
    """No function of theirs is called, in the run or where the scene is made."""

    def counts(**options):
        with Calls() as calls:
            list(simulate(alone(**options), dt=DT, until=STEPS * DT))
        return [calls.named(name) for name in names]

    assert counts() == [0] * len(names)
    assert min(counts(**option)) > 0


def test_without_gravity_and_loads_no_force_is_brought_to_the_nodes():
    """Neither is evaluated in any step, nor gravity because there are loads."""
    force = "skmpm.scene.prescribed.gravity_at"
    calls, states = run(alone())
    assert calls[force] == calls.named("Model.forces") == 0
    assert states[-1].report.energy.external == 0.0
    calls, states = run(alone(gravity=(0.0, -9.81)))
    assert calls[force] == STEPS
    calls, states = run(alone(loads=[Load(right, pulled)]))
    assert (calls[force], calls.named("Model.forces")) == (0, STEPS)


# --- inertia and transfer


def test_without_inertia_no_mass_enters_the_matrix_and_no_kinetic_energy_is_summed():
    """A held disc that is pulled: a thousand times its density changes nothing; with inertia it changes A."""

    def pull(density, inertia):
        matrices = []

        def keeping(A, blocks, motions):
            matrices.append(A.data.copy())
            return linear.banded(A, blocks, motions)

        scene = alone(supports=[Support(left)], loads=[Load(right, pulled)])
        body = replace(scene.bodies[0], material=replace(LINEAR, density=density), velocity=(0.0, 0.0))
        scheme = Scheme(inertia=inertia, linear=keeping)
        scene = replace(scene, bodies=[body])
        state = initial(scene, scheme=scheme)
        with Calls() as calls:
            step(scene, state, DT, scheme=scheme)
        return matrices[0], calls["skmpm.step.budget.kinetic_energy"]

    (light, none), (heavy, _) = pull(1.0, False), pull(1000.0, False)
    assert np.array_equal(light, heavy)
    assert none == 0
    (light, some), (heavy, _) = pull(1.0, True), pull(1000.0, True)
    assert not np.array_equal(light, heavy)
    assert some > 0


def test_held_bodies_are_solved_once_without_a_metric():
    """A static step of a body that supports hold is one solve of Newton's method, as a dynamic step is.

    The first two are solved again, since the contact has become too wide for a point that slides.
    """
    held = {"supports": [Support(lambda x: x[1] < 0.0)]}
    for options, scheme, solves in (({}, Scheme(), [1, 1, 1, 1]), (held, Scheme(inertia=False), [2, 2, 1, 1])):
        calls, states = run(squeezed(gravity=(0.0, -1.0), **options), scheme)
        assert [state.report.solves for state in states] == solves
        assert calls.named("newton.advance") == sum(solves)


def test_nodes_that_keep_their_velocities_get_no_momentum_from_points():
    """A uniform motion is brought to the nodes in the first step, without arms; then they keep their velocities.

    Two gradients a step: those that points take, and those by which the next step sees that they still have them.
    """
    calls, _ = run(squeezed())
    assert calls["skmpm.grid.transfer.to_points"] == STEPS
    assert calls["skmpm.grid.body_grids.BodyGrids.gradient_at_points"] == 2 * STEPS - 1
    assert calls["skmpm.grid.transfer.to_nodes"] - 1 == 1  # `initial` reports the kinetic energy of the nodes
    assert calls["skmpm.grid.body_grids.BodyGrids.affine_momentum"] == 0
