"""The numbers of a scene before it is run: sizes, motion in a step, what has to be solved, time and memory."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil

import numpy as np

from skmpm import linear
from skmpm.arrays import Array, Ints
from skmpm.grid import BodyGrids
from skmpm.linear.band import column_lengths, half_bandwidth
from skmpm.linear.choice import chosen
from skmpm.material import Material
from skmpm.observe.bodies import diameters
from skmpm.outline.measures import chord_sagitta
from skmpm.outline.widths import slit_width
from skmpm.scene import Scene
from skmpm.scheme import Scheme
from skmpm.step.derived import derived_data
from skmpm.step.driven import driven_by_force, prescribed_speeds
from skmpm.step.equations import LONG
from skmpm.step.initial_state import initial, initial_motion
from skmpm.stepping.functions_of_time import TIMES
from skmpm.stepping.loading import Loading, loading_of, several
from skmpm.stepping.step_length import MAX_APPROACH, STROKE, pace_of

# Of docs/studies/performance.md, on one thread [s]: a step, a point of it, one where things can touch, an unknown and
# squared half bandwidth of a banded matrix, an unknown of multigrid; quasi-static steps over those with inertia.
STEP, POINT, CONTACT, BAND, MULTIGRID, QUASISTATIC = 4e-3, 0.9e-6, 1.7e-6, 1e-10, 7e-6, 2.5
# Time of packings in long steps, whose contacts rearrange, over that: twice as many steps of four Newton iterations.
REARRANGING = 10.0
PARTS = 32  # of a run, in whose middles lengths of steps are looked at


@dataclass(frozen=True, eq=False, repr=False)
class SceneMetrics:
    """The numbers of a scene, each found when it is first asked for; its body grids are built, nothing is solved.

    Motions are those at t = 0 or after falling; of functions of time the largest values up to `until` [s] count.
    """

    scene: Scene
    dt: float  # of the first step [s]
    scheme: Scheme
    until: float | None  # [s]
    steps: int | None  # of the run, if its end is known
    chosen: bool  # whether `simulate` chooses the length of steps

    @cached_property
    def own(self) -> Ints:
        """Indices of the deformable bodies, (deformable,)."""
        return np.flatnonzero(self.scene.deformable)

    @property
    def points(self) -> Ints:
        """Number of points of each body, (bodies,)."""
        return np.diff(self.scene.offsets)

    @property
    def cell(self) -> float:
        """Side of the cells [m]."""
        return self.scene.cell

    @cached_property
    def resolution(self) -> Array:
        """R/h, R the radius of a disc of the body's area, (deformable,)."""
        return diameters(self.scene)[self.own] / (2.0 * self.cell)

    @property
    def points_per_cell(self) -> Array:
        """Points over the area in cells, (deformable,)."""
        return np.asarray(self.points[self.own] / (np.pi * self.resolution**2))

    @property
    def across(self) -> Array:
        """Cells across the thinnest part, (deformable,); nan without outline."""
        return np.asarray(self.scene.thickness[self.own] / self.cell)

    @cached_property
    def slit(self) -> Array:
        """Cells across the narrowest slit or hole, (deformable,); inf without one."""
        return np.asarray(slit_width(self.scene.outlines, self.boundary, self.points.size)[self.own] / self.cell)

    @cached_property
    def chords(self) -> Array:
        """Cells that chords of a smooth outline cut off from a width at most, (deformable,)."""
        sagitta = chord_sagitta(self.scene.outlines, self.boundary, self.points.size)
        return np.asarray(2.0 * sagitta[self.own] / self.cell)

    @property
    def boundary(self) -> Array:
        """Positions of the boundary points, (2, m) [m]."""
        return self.scene.initial_positions[:, self.scene.outlines.point]

    def extremes(self, quantity: Callable[[Material], float]) -> Array:
        """Smallest and largest value of a quantity of the materials of each deformable body, (2, deformable)."""
        value = {material: quantity(material) for material in self.scene.materials}
        each = [[value[material] for material in self.scene.bodies[b].materials] for b in self.own.tolist()]
        return np.array([[min(values), max(values)] for values in each]).T

    @cached_property
    def loading(self) -> Loading:
        """What drives the scene, at t = 0 or in the run."""
        return loading_of(self.scene, self.times)

    @property
    def times(self) -> Array:
        """Times at which functions of time are looked at, (k,) [s]."""
        if self.until is None:
            return np.zeros(1)
        return self.until * np.append(0.0, (np.arange(TIMES) + 0.5) / TIMES)  # a table of values may end before it

    @property
    def courant(self) -> float:
        """Distance dt c/h of pressure waves in a step [cells], 0 without inertia."""
        return self.scene.fastest_wave * self.dt / self.cell if self.scheme.inertia else 0.0

    @cached_property
    def fastest(self) -> tuple[str, float]:
        """The fastest wall, rigid body or support whose motion is prescribed, and its speed [m/s]; zero for none."""
        every = (named for t in self.times.tolist() for named in prescribed_speeds(self.scene, t))
        return max(every, key=lambda named: named[1], default=("", 0.0))

    @cached_property
    def driven(self) -> tuple[str, float]:
        """The fastest wall, rigid body or support, and how far it moves in a step [cells]; else what forces drive."""
        name, speed = self.fastest
        if not speed:
            return ", ".join(name for name, _ in driven_by_force(self.scene)), 0.0
        stroke = speed * self.dt / self.cell
        return name, min(stroke, STROKE) if self.chosen else stroke

    @property
    def approach(self) -> float:
        """Bound on the relative displacement of bodies in a step [cells]; 0 without inertia or contact."""
        approach = self.loading.approach * self.dt / self.cell if self.touches and self.scheme.inertia else 0.0
        return min(approach, MAX_APPROACH) if self.chosen else approach

    @property
    def fall(self) -> float:
        """Free height of fall [m]; 0 without inertia, and where steps are chosen, which get shorter by then."""
        return self.loading.fall if self.scheme.inertia and not self.chosen else 0.0

    @cached_property
    def at_rest(self) -> bool:
        """Whether no body that forces move has a velocity at t = 0."""
        return not initial_motion(self.scene)[0][:, self.scene.movable[self.scene.owner]].any()

    @property
    def touches(self) -> bool:
        """Whether contact is possible."""
        return self.scene.can_touch

    @property
    def cohesion(self) -> float:
        """Largest cohesion of contacts that are possible [Pa]."""
        each = [self.scene.cohesion, *(wall.cohesion for wall in self.scene.walls)]
        return float(max(each)) if self.touches else 0.0

    @cached_property
    def grid(self) -> BodyGrids:
        """The first body grids."""
        return self._grid_and_columns[0]

    @property
    def unknowns(self) -> int:
        """Number of nodal unknowns."""
        return 2 * self.grid.nodes

    @property
    def half_bandwidth(self) -> int:
        """Half bandwidth of the matrix that is factorised."""
        return half_bandwidth(self._grid_and_columns[1])

    @property
    def solver(self) -> str:
        """Name of the solver that `linear.default` selects, or of the scheme's own."""
        default = self.scheme.linear is linear.default
        solver = chosen(self._grid_and_columns[1]) if default else self.scheme.linear
        return str(getattr(solver, "__name__", type(solver).__name__))

    @cached_property
    def _grid_and_columns(self) -> tuple[BodyGrids, Ints]:
        """The body grids, and the lengths (nodes,) of the columns of the factor of their matrix.

        Supports eliminate nodes, which couples others and reorders them.
        """
        scene = self.scene
        data = derived_data(scene, self.scheme, scene.initial_positions, scene.initial_volumes)
        grid, pattern = data.assembly.grid, data.assembly.ghost_data
        A = data.assembly.matrix(np.random.default_rng(0).random(pattern.shape), 1.0)  # whose entries do not cancel
        if data.supports is not None:
            A, _ = data.supports.reduced(A, grid.blocks)
        return grid, column_lengths(A, grid.blocks)

    @property
    def memory(self) -> float:
        """Peak memory of a run in addition to the program [bytes]."""
        boundary = self.scene.outlines.size if self.touches else 0
        return memory_of(int(self.points.sum()), self.unknowns, boundary, self.half_bandwidth, self.solver)

    @property
    def seconds_of_step(self) -> float:
        """Time of a step on one thread, to an order of magnitude [s]."""
        size = (int(self.points.sum()), self.unknowns, self.half_bandwidth, self.solver)
        each = seconds_of_step(*size, touches=self.touches, inertia=self.scheme.inertia)
        long = self.courant > LONG or not self.scheme.inertia
        return REARRANGING * each if long and self.touches and several(self.scene) else each

    @property
    def seconds(self) -> float | None:
        """Time of the run on one thread, to an order of magnitude [s]; None if its end is not known."""
        return None if self.steps is None else self.steps * self.seconds_of_step


def memory_of(points: int, unknowns: int, boundaries: int, width: int, solver: str) -> float:
    """Peak memory of a run in addition to the program [bytes]; `boundaries` is the number of boundary points.

    4 MB + 1.2 kB a point + 5 kB a boundary point, and for the matrix two bands of half bandwidth `width`, of the step
    and of the one before it, or 1.8 kB an unknown by any other solver. Fitted to peak resident sizes above those
    after import, of which estimates are 0.7 to 1.5 (`test_memory_is_what_was_measured`).
    """
    matrix = 16.0 * (width + 1) * unknowns if solver == "banded" else 1.8e3 * unknowns
    return 4e6 + 1.2e3 * points + 5e3 * boundaries + matrix


def seconds_of_step(
    points: int, unknowns: int, width: int, solver: str, *, touches: bool = True, inertia: bool = True
) -> float:
    """The time of a step in which no contacts rearrange [s]."""
    matrix = BAND * width**2 if solver == "banded" else MULTIGRID
    seconds = STEP + points * (POINT + (CONTACT if touches else 0.0)) + unknowns * matrix
    return seconds if inertia else QUASISTATIC * seconds


def chosen_steps(scene: Scene, scheme: Scheme, until: float | None) -> tuple[float, int | None]:
    """The first step that `simulate` chooses [s], and the number of steps until an end.

    Bodies move as at the beginning, and neither Newton's method nor losses shorten a step. The first one resolves
    waves where only losses limit it; it is 1 s if nothing does.
    """
    parts = (np.arange(PARTS) + 0.5) / PARTS
    times = np.append(0.0, () if until is None else until * parts)
    state, pace = initial(scene, scheme=scheme), pace_of(scene, scheme, 0.0, until or 0.0)
    longest = np.array([pace.limit(scene, replace(state, t=float(t)), np.inf) for t in times])
    first = float(longest[0]) if np.isfinite(longest[0]) else pace.resolving if pace.losses else 1.0
    if until is None:
        return first, None
    return first, ceil(float((until / PARTS / np.minimum(longest[1:], until)).sum()) - 1e-9)
