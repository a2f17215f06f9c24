"""What `study.py` compares: features on and off, in scenes that start from the same state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np

import skmpm

from ..benchmark import scenes as boxes
from ..benchmark.scenes import DT, GEL, SPACING, SPEED_UP

RADIUS = 1e-3  # of the large disc [m]
FRACTION = 0.85  # nominal solid fraction of the packing
SLAB = 4.0  # thickness of a wall of points [cells]
SPEED = 0.5  # of plates and of discs that meet [m/s]


@dataclass(frozen=True)
class Variant:
    """A scene, where it starts and how it is solved."""

    scene: skmpm.Scene
    first: skmpm.State | None = None  # None: its beginning
    scheme: skmpm.Scheme = field(default_factory=skmpm.Scheme)

    def start(self) -> skmpm.State:
        """The state to start from."""
        return skmpm.initial(self.scene, scheme=self.scheme) if self.first is None else self.first

    def solved(self, **options: Any) -> Variant:
        """The same with another scheme."""
        return replace(self, scheme=replace(self.scheme, **options))


@dataclass(frozen=True)
class Feature:
    """A line of the table."""

    name: str  # on against off
    scene: str
    spared: str  # what is not done when it is off
    counts: tuple[str, ...]
    tests: tuple[str, ...]
    on: Variant
    off: Variant


def material(law: str) -> skmpm.material.Material:
    """The gel of the main job by that law, or `Rigid`."""
    return skmpm.Rigid(GEL["density"]) if law == "Rigid" else getattr(skmpm, law)(**GEL)


def centre(cells: float) -> np.ndarray:
    """Of the large disc, anywhere in a cell, (2,) [m]."""
    return RADIUS / cells * np.array([0.3, 0.4])


def large(cells: float, law: str = "NeoHookean", shift: float = 0.0, **motion: Any) -> skmpm.Body:
    """A disc of so many cells per radius, shifted upwards [m]."""
    middle = centre(cells) + np.array([0.0, shift])
    return skmpm.Body(skmpm.disc(middle, RADIUS, spacing=SPACING * RADIUS / cells), material(law), **motion)


def alone(cells: float, law: str = "NeoHookean", **options: Any) -> Variant:
    """A disc that swings by about 1 % and touches nothing."""
    body = large(cells, law, velocity=options.pop("velocity", boxes.swing(centre(cells), RADIUS)))
    return Variant(skmpm.Scene([body], cell=RADIUS / cells, **options))


def squeezed(cells: float, law: str = "NeoHookean") -> Variant:
    """A disc between two plates, one of which comes down."""
    (x, y), down = centre(cells), (0.0, -SPEED)
    plates = [skmpm.Wall((x, y - RADIUS), (0.0, 1.0)), skmpm.Wall((x, y + RADIUS), (0.0, -1.0), velocity=down)]
    return Variant(skmpm.Scene([large(cells, law)], cell=RADIUS / cells, walls=plates))


def meeting(cells: float, law: str) -> Variant:
    """A disc that meets one of that law, which comes towards it."""
    up, down = (0.0, SPEED), (0.0, -SPEED)
    upper = large(cells, shift=2.001 * RADIUS, velocity=down)
    lower = large(cells, law, **({"motion": (*up, 0.0)} if law == "Rigid" else {"velocity": up}))
    return Variant(skmpm.Scene([upper, lower], cell=RADIUS / cells))


def pulled(cells: float) -> Variant:
    """A disc held at its left and pulled at its right, by .05 % more in every step."""
    (x, _), stress = centre(cells), 5e-4 * GEL["E"]
    held = skmpm.Support(lambda at: at[0] < x - 0.9 * RADIUS)
    load = skmpm.Load(lambda at: at[0] > x + 0.9 * RADIUS, lambda t: (stress * RADIUS * t / DT, 0.0))
    return alone(cells, velocity=(0.0, 0.0), supports=[held], loads=[load])


@cache
def packing(discs: int, cells: float, friction: float = 0.5, law: str = "NeoHookean") -> Variant:
    """Discs squeezed to `FRACTION` faster than they will be measured, and slowed down."""
    fast, slow = (boxed(discs, cells, friction, law, speed_up) for speed_up in (SPEED_UP, 1.0))
    return Variant(slow, boxes.squeeze(fast, FRACTION))


def boxed(discs: int, cells: float, friction: float, law: str, speed_up: float) -> skmpm.Scene:
    """As in the benchmark, of that law."""
    scene = boxes.boxed(discs, cells, friction, speed_up=speed_up)
    return replace(scene, bodies=[replace(body, material=material(law)) for body in scene.bodies])


def rough(planes: Variant) -> Variant:
    """The same with walls as rough as the bodies."""
    walls = [replace(wall, friction=planes.scene.friction) for wall in planes.scene.walls]
    return replace(planes, scene=replace(planes.scene, walls=walls))


def slabbed(planes: Variant) -> Variant:
    """The same packing between walls that are bodies of rigid points."""
    scene, state, first = planes.scene, planes.start(), [wall.point for wall in planes.scene.walls]
    width, height, t = first[3][0], first[1][1], SLAB * scene.cell
    boxes = [((0, -t), (width, t)), ((0, height), (width, t)), ((-t, -t), (t, height + 2 * t)),
              ((width, -t), (t, height + 2 * t))]  # fmt: skip
    slabs = [
        skmpm.Body(skmpm.box(*box, spacing=SPACING * scene.cell), material("Rigid"), motion=(*wall.velocity, 0.0))
        for box, wall in zip(boxes, scene.walls, strict=True)
    ]
    whole = replace(scene, bodies=[*scene.bodies, *slabs], walls=())
    begin, n = skmpm.initial(whole), state.body.size

    def joined(name: str) -> np.ndarray:
        return np.concatenate([getattr(state, name), getattr(begin, name)[..., n:]], axis=-1)

    fields = {name: joined(name) for name in ("x", "v", "F", "C", "stress", "volume", "weight")}
    fields["x"][:, n:] += (state.walls - np.array(first)).T[:, begin.body[n:] - len(scene.bodies)]
    return Variant(whole, replace(begin, t=state.t, displacement=state.displacement, **fields))


def features(discs: int, cells: float, size: float) -> list[Feature]:
    """All lines of the table; the packing's discs have `cells` cells per radius, the single one `size`."""
    return [*_contact(discs, cells, size), *_bulk(discs, cells, size), *_outside(size), *_grid(discs, cells, size)]


def _contact(discs: int, cells: float, size: float) -> list[Feature]:
    """Contact, friction, walls, rigid bodies."""
    far = [skmpm.Wall((0.0, -5.0 * RADIUS), (0.0, 1.0))]
    dense, enters = packing(discs, cells), "calls in `contact` and `coulomb`"
    never = (
        "test_a_single_body_without_walls_never_enters_the_contact_module",
        "test_one_body_without_walls_runs_no_function_of_contact_and_coulomb",
    )
    none = "no function of `contact` and `coulomb` is called, no overlap looked for"
    return [
        Feature("a wall out of reach / no wall", "disc alone", none, (enters, "contacts", "Newton", "solves"),
                (*never, "test_a_wall_out_of_reach_brings_no_compliance_and_no_solve_more_than_convergence_needs",
                 "test_bodies_out_of_each_others_reach_are_not_projected_on_one_another"),
                alone(size, walls=far), alone(size)),
        Feature("contact with one body / none", "disc squeezed / alone", none,
                (enters, "contacts", "rows of W", "Newton", "solves"), never, squeezed(size), alone(size)),
        Feature("friction 0.5 / 0", "packing", "tangential unknowns and rows",
                ("contacts", "rows of W", "rows of geometric stiffness", "Newton", "contact iterations"),
                ("test_friction_0_leaves_no_tangential_unknown",), dense, packing(discs, cells, 0.0)),
        Feature("walls of rigid points / planes", "packing, rough walls",
                "boundaries and curves of walls (neither has unknowns)",
                ("unknowns", "contacts", "rows of W", "Newton", "factorisations", "contact iterations"),
                ("test_walls_of_rigid_points_have_no_unknowns_and_touch_no_other_wall",
                 "test_bodies_out_of_each_others_reach_are_not_projected_on_one_another"), slabbed(rough(dense)),
                rough(dense)),
        Feature("a deformable / a rigid body", "two discs meet", "its unknowns and its block of A",
                ("unknowns", "blocks of A", "contacts", "Newton"), ("test_rigid_bodies_and_walls_have_no_unknowns",),
                meeting(size, "NeoHookean"), meeting(size, "Rigid")),
    ]  # fmt: skip


def _bulk(discs: int, cells: float, size: float) -> list[Feature]:
    """Material, locking, ghost penalty, inertia."""
    dense, linear = packing(discs, cells), alone(size, "LinearElastic")
    spared = "line searches, matrices of steps after the first, iterations without contact"
    counts = ("Newton", "factorisations", "solves", "line searches")
    once = "test_a_linear_material_factorises_once_for_as_long_as_dt_and_anchor_stay"
    tests = (once, "test_a_linear_material_makes_one_tangent_and_searches_no_line",
             "test_the_potential_of_a_linear_material_is_never_evaluated")  # fmt: skip
    boundary = "test_a_linear_material_computes_its_delassus_operator_once"
    exact = "test_a_single_free_linear_body_does_exactly_one_solve_per_step"
    ghost = ("blocks of A that are of no cell, products with them", ("blocks of A", "half bandwidth", "Newton"),
             ("test_ghost_0_leaves_no_entry_in_the_matrix_that_the_cells_do_not_make",
              "test_ghost_0_sums_no_force_and_no_energy"))  # fmt: skip
    mean = ("means over cells, their part of tangents", ("means of dilatation", "Newton"),
            ("test_off_nothing_of_it_is_computed",))  # fmt: skip
    return [
        Feature("NeoHookean / LinearElastic", "disc alone", spared, counts, (*tests, exact), alone(size), linear),
        Feature("NeoHookean / LinearElastic", "packing", spared, counts, (*tests, boundary), dense,
                packing(discs, cells, 0.5, "LinearElastic")),
        Feature("mean dilatation", "disc alone", *mean, alone(size), alone(size).solved(mean_dilatation=False)),
        Feature("mean dilatation", "packing", *mean, dense, dense.solved(mean_dilatation=False)),
        Feature("ghost 0.005 / 0", "disc alone", *ghost, alone(size), alone(size).solved(ghost=0.0)),
        Feature("ghost 0.005 / 0", "disc squeezed", *ghost, squeezed(size), squeezed(size).solved(ghost=0.0)),
        Feature("inertia", "disc held and pulled", "mass in A, kinetic energy", ("kinetic energies", "Newton"),
                ("test_without_inertia_no_mass_enters_the_matrix_and_no_kinetic_energy_is_summed",), pulled(size),
                pulled(size).solved(inertia=False)),
    ]  # fmt: skip


def _outside(size: float) -> list[Feature]:
    """Gravity, loads, supports."""
    middle, off = centre(size), alone(size, "LinearElastic")

    def edge(axis: int, side: float) -> Callable[[np.ndarray], np.ndarray]:
        return lambda x: side * (x[axis] - middle[axis]) > 0.9 * RADIUS

    heavy = alone(size, "LinearElastic", gravity=(0.0, -9.81))
    loaded = alone(size, "LinearElastic", loads=[skmpm.Load(edge(0, 1.0), (1.0, 0.0))])
    held = [alone(size, supports=[skmpm.Support(edge(axis, -1.0))]) for axis in (1, 0)]
    nothing = "test_without_gravity_and_loads_no_force_is_brought_to_the_nodes"
    found = "test_without_loads_and_supports_no_point_set_is_found"
    spared = ("search for its points, elimination", ("eliminations", "half bandwidth", "Newton", "factorisations"),
              ("test_a_scene_without_supports_eliminates_nothing", found))  # fmt: skip
    return [
        Feature("gravity", "linear disc alone", "its force", ("gravity evaluated",),
                ("test_zero_gravity_forms_nothing", nothing), heavy, off),
        Feature("a load", "linear disc alone", "search for its points, its force", ("loads evaluated",),
                (nothing, found), loaded, off),
        Feature("a support along rows of nodes", "disc held at the bottom / alone", *spared, held[0], alone(size)),
        Feature("a support across rows of nodes", "disc held at the left / alone", *spared, held[1], alone(size)),
    ]  # fmt: skip


def _grid(discs: int, cells: float, size: float) -> list[Feature]:
    """How often Body grids are built, and what that takes."""
    spared = "body grids, weights and patterns after the first step"
    counts = ("body grids built", "weights fitted", "patterns made", "Newton")
    tests = ("test_without_regridding_grids_are_built_fitted_and_numbered_once_in_a_run",)
    dense, anew = packing(discs, cells), alone(size).solved(anchor=0.0)
    linear = alone(size, "LinearElastic").solved(anchor=0.0)
    return [
        Feature("anchored at every step / once", "disc alone", spared, counts, tests, anew, alone(size)),
        Feature("anchored at every step / once", "packing", spared, counts, tests, dense.solved(anchor=0.0), dense),
        Feature("fitted", "linear disc alone, anchored at every step", "outlines cut by cells, moments fitted",
                ("weights fitted", "outlines cut by cells", "blocks of A", "Newton"),
                ("test_without_fitting_no_cell_is_cut_by_an_outline",), linear, linear.solved(moment_fitting=False)),
    ]  # fmt: skip
