"""The state of a scene, with the report of its last step."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from skmpm.representation import line, table, with_shapes
from skmpm.units import quantity

if TYPE_CHECKING:
    from skmpm.assembly import Assembly
    from skmpm.constraint_elimination import Elimination
    from skmpm.linear import Delassus, Solver

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class StepFailed(RuntimeError):  # noqa: N818  (public name)
    """A step that failed; `state` is the last good one, `retryable` whether a smaller dt may help."""

    def __init__(self, message: str, state: State, *, retryable: bool = True) -> None:
        super().__init__(message)
        self.state, self.retryable = state, retryable


@dataclass(frozen=True, repr=False)
class Contacts:
    """The contacts at the end of a step; walls are bodies -1, -2, ...

    Attributes
    ----------
    bodies : (2, k) the two bodies, walls -1, -2, ...; the same twice where parts of one body touch
    x : (2, k) contact points [m]
    normal : (2, k) unit, from the second to the first body
    force : (2, k) [N/m] on the first body, in (n, t), t = (-n_y, n_x)
    gap : (k,) distance, negative where boundaries overlap [m]
    key : (k,) identity of a contact from step to step, for the warm start
    point : (k,) boundary point of the first body in contact; -1 at a grid node
    image : (2, k) displacement of the second body to its image that the first one touches [m]; zero but in a
        periodic box. `x` is where the first body is
    """

    __repr__ = with_shapes

    bodies: Ints
    x: Array
    normal: Array
    force: Array
    gap: Array
    key: Ints
    point: Ints
    image: Array

    def at(self, side: int) -> Array:
        """The contact points where the first (0) or the second bodies (1) are, (2, k) [m]."""
        return self.x - self.image if side else self.x

    @property
    def vectors(self) -> Array:
        """Forces on the first bodies in x and y, (2, k) [N/m]."""
        n = self.normal
        return np.asarray(self.force[0] * n + self.force[1] * np.stack([-n[1], n[0]]))

    @staticmethod
    def none() -> Contacts:
        """No contacts."""
        ints, floats = np.zeros((2, 0), dtype=np.int64), np.zeros((2, 0))
        return Contacts(ints, floats, floats, floats, floats[0], ints[0], ints[0], floats)


@dataclass(frozen=True)
class Energy:
    """The energy budget [J/m]; terms other than kinetic, elastic and springs are sums since t = 0.

    Attributes
    ----------
    kinetic : of the nodal velocities
    elastic : including the ghost penalty, and what hardening of materials stores
    external : work of gravity, loads, walls, supports and moving ends of springs. With inertia, by the forces at
        t + theta dt, on which the step is based: with long steps of slow motion and theta = 1 larger than by the
        trapezoidal rule, by a tenth in 15 steps, and `dissipated` with it
    push_out : work of contacts that remove an overlap of an earlier step
    cohesion : work of cohesive contacts on gaps that close, negative where they open
    regridding : change of the points' energy by regridding
    viscous : dissipated by the viscosity of materials
    plastic : dissipated by changes of internal variables of materials, as by plastic flow
    springs : stored in springs
    dissipated : the remainder: friction, impacts, the time scheme, the transfer
    """

    kinetic: float = 0.0
    elastic: float = 0.0
    external: float = 0.0
    push_out: float = 0.0
    cohesion: float = 0.0
    regridding: float = 0.0
    viscous: float = 0.0
    plastic: float = 0.0
    springs: float = 0.0
    dissipated: float = 0.0


@dataclass(frozen=True)
class StepControl:
    """Step control of `simulate`: with a requested dt, after failures the next step is dt / 2^halvings.

    Attributes
    ----------
    dt : [s] the requested step; 0 if steps are chosen
    halvings : of the requested step
    successes : successful steps since the last failure or doubling
    part : completed part of the requested step [1/1024]
    chosen : [s] where steps are chosen, the next one at most; 0 before the first
    """

    dt: float = 0.0
    halvings: int = 0
    successes: int = 0
    part: int = 0
    chosen: float = 0.0


@dataclass(frozen=True, repr=False)
class Report:
    """Cost and residuals of a step.

    Attributes
    ----------
    dt : length of the step [s]
    retries : failures of longer steps before this one
    newton : Newton iterations
    factorisations : factorisations of A
    contact : iterations of the contact solver, over all Newton iterations
    residual : natural-map residual of the contact law at the end of the step
    imbalance : residual of the momentum balance over the largest of its terms
    frozen_normals : whether contact normals are those of an earlier Newton iteration
    unbalanced : largest resultant force on a body over the mean contact force (`simulate.unbalanced`)
    overlap : area shared by bodies / area of all bodies
    energy : energy budget, an `Energy`
    seconds : wall time by phase [s]
    """

    dt: float = 0.0
    retries: int = 0
    newton: int = 0
    factorisations: int = 0
    contact: int = 0
    residual: float = 0.0
    imbalance: float = 0.0
    frozen_normals: bool = False
    unbalanced: float = 0.0
    overlap: float = 0.0
    energy: Energy = Energy()
    seconds: dict[str, float] = field(default_factory=dict)

    def __repr__(self) -> str:
        return line("Report", self._facts())

    def _repr_html_(self) -> str:
        return table(
            "Report", self._facts() | {f"{name} [s]": f"{value:.3g}" for name, value in self.seconds.items()}
        )

    def _facts(self) -> dict[str, object]:
        facts: dict[str, object] = {"dt =": quantity(self.dt, "s"), "Newton iterations": self.newton}
        facts |= {"contact iterations": self.contact, "retries": self.retries, "residual": f"{self.residual:.2g}"}
        facts |= {"imbalance": f"{self.imbalance:.2g}", "overlap": f"{self.overlap:.2g}"}
        return facts | {"took": quantity(sum(self.seconds.values()), "s")}


@dataclass(frozen=True, repr=False)
class State:
    """Everything needed for a restart; arrays are read-only by convention.

    Attributes
    ----------
    t : time [s]
    x : (2, n) positions [m]
    v : (2, n) velocities [m/s]
    F : (2, 2, n) deformation gradients, [i, j] = dx_i / dX_j
    C : (2, 2, n) affine velocity (APIC), by anchor position [1/s]
    stress : (2, 2, n) elastic Cauchy stress [Pa], tension positive; without what viscosity adds
    mass : (n,) [kg/m]
    volume : (n,) current [m2]
    weight : (n,) current quadrature weights of the points [m2]
    internal : (k, n) internal variables of materials with memory, in the order of their `state0`; zero where a
        material has fewer, (0, n) if none has any
    body : (n,)
    x_anchor : (2, n) positions when the body grids were built [m]
    F_anchor : (2, 2, n)
    stress_anchor : (2, 2, n) stress then [Pa]
    displacement : (2 nodes,) of the nodes since the body grids were built [m]
    walls : (walls, 2) a point of each wall [m]
    wall_normals : (walls, 2) unit, towards the free side
    wall_force : (walls, 2) exerted by the bodies in the last step [N/m]
    wall_velocity : (walls, 2) of walls that a force drives; of others in the last step [m/s]
    support_force : (supports, 2) the same on each support [N/m]
    box : (2, 2) edges of the periodic box as columns [m]; None without one. The second one is replaced by that of the
        same lattice that leans least, so a shear strain follows from `box_rate`, not from the edges
    box_rate : (2, 2) its velocity gradient [1/s]; None without one
    contacts : those at the end of the last step, `Contacts`
    report : cost and residuals of the last step, a `Report`
    step_control : what `simulate` continues with
    derived : cached data that follow from the rest
    """

    t: float
    x: Array
    v: Array
    F: Array
    C: Array
    stress: Array
    mass: Array
    volume: Array
    weight: Array
    internal: Array
    body: Ints
    x_anchor: Array
    F_anchor: Array
    stress_anchor: Array
    displacement: Array
    walls: Array
    wall_normals: Array
    wall_force: Array
    wall_velocity: Array
    support_force: Array
    contacts: Contacts
    report: Report
    step_control: StepControl = StepControl()
    box: Array | None = None
    box_rate: Array | None = None
    derived: Derived | None = field(default=None, repr=False, compare=False)

    @property
    def body_force(self) -> Array:
        """Resultant of the contact forces of the last step on each body, rigid ones included, (2, bodies) [N/m]."""
        return np.stack([self._on_bodies(component, component) for component in self.contacts.vectors])

    @property
    def body_moment(self) -> Array:
        """Moment of these forces about the centre of mass of each body, (bodies,) [N], counter-clockwise."""
        fx, fy = self.contacts.vectors
        arms = (self.contacts.at(side) for side in (0, 1))
        moment = self._on_bodies(*(x * fy - y * fx for x, y in arms))
        cx, cy = (np.bincount(self.body, self.mass * x) / np.bincount(self.body, self.mass) for x in self.x)
        (rx, ry) = self.body_force
        return np.asarray(moment - (cx * ry - cy * rx))

    def _on_bodies(self, values: Array, on_second: Array) -> Array:
        """Sums of values (k,) on the first bodies of contacts, less those of others on the second ones, (bodies,)."""
        first, second = self.contacts.bodies
        count = int(self.body.max()) + 1
        against = second >= 0
        return np.asarray(np.bincount(first, values, count) - np.bincount(second[against], on_second[against], count))

    def __repr__(self) -> str:
        return line("State", self._facts())

    def _repr_html_(self) -> str:
        return table("State", self._facts() | {"last step": self.report})

    def _facts(self) -> dict[str, object]:
        energy, facts = self.report.energy, dict[str, object]()
        facts |= {"t =": quantity(self.t, "s"), "bodies": int(self.body.max(initial=-1)) + 1}
        facts |= {"points": self.x.shape[1], "contacts": self.contacts.gap.size}
        return facts | {"kinetic energy [J/m]": f"{energy.kinetic:.3g}", "elastic": f"{energy.elastic:.3g}"}


@dataclass(frozen=True)
class Derived:
    """Cached data that follow from the rest of the state; not saved, rebuilt on demand."""

    assembly: Assembly
    ghost: Array  # (cells,) moduli of the ghost penalty in `assembly` [Pa]
    moment_fitting: bool  # whether the weights in `assembly` are fitted
    supports: Elimination | None  # of the unknowns that supports determine
    supporting: Ints  # (2, n) the support that prescribes each component of the points' velocities, -1 where none
    key: tuple[object, ...] = ()  # of the matrix that `solver` was made for
    solver: Solver | None = None
    delassus: Delassus | None = None  # of the contact points, by this solver
    configuration: object = None  # `implicit.Configuration` of the bodies at the displacement of the state, or None
    of_materials: tuple[object, ...] = ()  # what the configuration depends on besides
