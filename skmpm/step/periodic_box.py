"""How bodies move with a periodic box, and how a stress moves it.

A body and its image at H k have velocities that differ by dH/dt k. So that it does not matter which of them is
followed, inertia resists changes of the velocity relative to that of the box at the centre of the body, as in the
equations of motion for homogeneous flow (SLLOD; Evans & Morriss, Statistical Mechanics of Nonequilibrium Liquids,
2008, section 6.3), and the kinetic energy is that of the relative velocities.

An unknown is the rate of a component times the length of an edge, so the speed of an edge, whose mass resists changes
of it. A change of the rate L_e moves the edges at the end of the step by multiples of E_e H, E_e the unit tensor of
the component, and the stress sigma does the work A sigma_e on it, with A the area of the box at the end of the step.
The contacts do the work f . E_e (c1 - c2 - H k), c1 and c2 the centres of the bodies, the second at the image H k: so
the stress of all contacts (Love and Weber) is the given one. Without inertia bodies are where contacts hold them, and
only images move: -f . E_e H k, the same where the bodies are in equilibrium. Velocities of bodies are relative to the
mean motion of the box in a step, which is therefore its velocity at the end: steps of the box are backward Euler's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from skmpm import outline
from skmpm.arrays import Array, Bools
from skmpm.contact import Constraints
from skmpm.scene import Contacts, Periodic, PrescribedVelocities, Scene, State, deformed, recut
from skmpm.scene.contact_keys import ContactKeys
from skmpm.step.errors import StepRejected
from skmpm.step.scalar_unknowns import Entries, Interval, Unknowns


def velocity_of_box(state: State, gradient: Array | None) -> Array:
    """Velocity of the box at the centres of the bodies, at their nodes (2 nodes,) [m/s]; zero without a box."""
    grid = state.grids.assembly.grid
    if gradient is None:
        return np.zeros(2 * grid.nodes)
    return np.asarray((gradient @ state.centres)[:, grid.node_body].T.ravel())


def recut_box(scene: Scene, box: Array | None, contacts: Contacts) -> tuple[Array | None, Contacts]:
    """The least slanted edges [m] of the same lattice, and the contacts with keys that belong to them."""
    if box is None or box.shape[1] == 1:
        return box, contacts
    upright, change = recut(box)
    if not change[0, 1]:
        return box, contacts
    curve = outline.curve(scene.outlines, scene.initial_positions[:, scene.outlines.point])
    keys = ContactKeys(scene.outlines.size, curve.sides, box.shape[1])
    return upright, replace(contacts, key=keys.recut(contacts.key, change))


@dataclass(frozen=True)
class StressedBox(Unknowns):
    """The box of a scene in one step."""

    periodic: Periodic
    start: Array  # (2, 2) edges at the start of the step [m]
    rate: Array  # (2, 2) the prescribed gradient [1/s]
    stress: Array  # (q,) [Pa]
    length: Array  # (q,) of the edges that the unknowns move, at the start of the step [m]
    centres: Array  # (2, bodies) of bodies that move with it, zero of others, as those with supports or springs [m]

    @staticmethod
    def in_step(scene: Scene, periodic: Periodic, state: State, interval: Interval) -> StressedBox:
        """The box of a state in a step."""
        assert state.box is not None and state.box_rate is not None
        (i, j), dt = periodic.components, interval.dt
        length = np.diag(state.box)[j]
        mass = np.full(i.size, scene.mass if periodic.mass is None else float(periodic.mass))
        # Moving those with supports or springs with the box would change the forces of springs.
        carried = scene.movable & ~(scene.supported_bodies.any(axis=0) | scene.sprung_bodies) & interval.inertial
        return StressedBox(
            replace(interval, theta=1.0).inertia(mass, state.box_rate[i, j] * length),
            dt,
            0,
            periodic,
            state.box,
            periodic.rate_at(state.t + 0.5 * dt),
            periodic.stress_at(interval.t),
            length,
            state.centres * carried,
        )

    @property
    def names(self) -> list[str]:
        """The components of its stress."""
        return [f"the stress {'xy'[i]}{'xy'[j]} of the periodic box" for i, j in self.periodic.components.T.tolist()]

    @property
    def counted(self) -> Bools:
        """None: its masses are not those of bodies, and it works on these by contacts of their images, (q,)."""
        return np.zeros(self.inertia.v0.size, dtype=bool)

    def _edges(self, z: Array) -> Array:
        """The edges at the end of the step, (2, 2) [m]; StepRejected if a side has shrunk to nothing."""
        edges = deformed(self.start, self.rate, self.dt, self.periodic.components, z / self.length)
        if np.diag(edges).min() <= 0.0:
            raise StepRejected("the periodic box", "its stress shrinks a side to nothing, as no contact presses")
        return edges

    @cached_property
    def _first_edges(self) -> Array:
        """The edges at the end of the step, if the rates stayed as they are at its start, (2, 2) [m]."""
        return self._edges(self.inertia.v0)

    def _scale(self, z: Array) -> Array:
        """Change of the edges at the end of the step by an unknown, over dt E_e H (`scene.periodic`), (q,) [1/m]."""
        i, j = self.periodic.components
        L = np.zeros((2, 2))
        L[i, j] = z / self.length
        stretch = 1.0 + self.dt * np.diag(L)
        return np.asarray(np.where(i == j, 1.0 / stretch[i], stretch[0] / stretch[1]) / self.length)

    def load(self, z: Array) -> Array:
        """Forces of the stress on the edges, (q,) [N/m]."""
        return np.asarray(abs(float(np.linalg.det(self._edges(z)))) * self.stress * self._scale(z))

    def load_at_start(self) -> Array:
        """Zero: forces when the step begins are not known, (q,)."""
        return np.zeros_like(self.stress)

    def motions(self, z: Array, end: Array, prescribed: PrescribedVelocities) -> PrescribedVelocities:
        """All prescribed velocities with the motion of the box."""
        return replace(prescribed, box=self._edges(z))

    def translation(self, z: Array) -> Array:
        """Velocities of bodies by the change of the gradient in the step, (2, bodies) [m/s]."""
        change = (self._edges(z) - self._first_edges) @ np.linalg.inv(self.start) / self.dt
        return np.asarray(change @ self.centres)

    def rows(self, z: Array, constraints: Constraints, directions: Sequence[Array]) -> Entries:
        """From z to relative velocities, d k rows: bodies move with their centres, the second one with its image."""
        i, j = self.periodic.components
        centre = self._edges(z) @ np.linalg.solve(self.start, self.centres)
        first, second = (np.where(body < 0, 0.0, centre[:, np.maximum(body, 0)]) for body in constraints.bodies)
        branch = first - second - constraints.image
        each = [d[i] * branch[j] * self._scale(z)[:, None] for d in directions]  # (q, k)
        rows = np.stack([block.T for block in each], axis=1).reshape(-1, i.size)
        row, column = np.indices(rows.shape)
        return Entries(rows.ravel(), row.ravel(), self.first + column.ravel())
