"""The state of a scene."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from skmpm.assembly import Assembly
from skmpm.constraint_elimination import Elimination
from skmpm.linear import Delassus, Solver
from skmpm.representation import line, table
from skmpm.scene.contacts import Contacts
from skmpm.scene.report import Report, StepControl
from skmpm.scene.rigid_motion import centres
from skmpm.units import quantity

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class StepFailed(RuntimeError):  # noqa: N818  (public name)
    """A step that failed after `retries` with longer dt; `state` is the last good one.

    `retryable` is whether a smaller dt may help.
    """

    def __init__(self, message: str, state: State, *, retryable: bool = True, retries: int = 0) -> None:
        super().__init__(message)
        self.state, self.retryable, self.retries = state, retryable, retries


@dataclass(frozen=True, repr=False)
class State:
    """Everything needed for a restart; arrays are read-only by convention.

    Attributes
    ----------
    t : time [s]
    x : (2, n) positions [m]
    v : (2, n) velocities [m/s]
    F : (2, 2, n) deformation gradients, [i, j] = dx_i / dX_j, where the strains of the points are evaluated
        (`Scheme.moment_fitting`); I in rigid bodies, however they turn
    C : (2, 2, n) affine velocity (APIC), by anchor position [1/s]; zero in rigid bodies, whose spin is that of `v`
    stress : (2, 2, n) elastic Cauchy stress there [Pa], tension positive; without what viscosity adds
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
    nodal_velocity : (2 nodes,) of the nodes [m/s], from which bodies go on whose points have the v and C that they
        give; others, as after a change of v or C, and where it is empty, for new body grids, from those of the points
    walls : (walls, 2) a point of each wall [m]
    wall_normals : (walls, 2) unit, towards the free side
    wall_force : (walls, 2) exerted by the bodies in the last step [N/m]
    wall_velocity : (walls, 2) of walls that a force drives; of others in the last step [m/s]
    support_force : (supports, 2) the same on each support [N/m]
    box : (2, 2) edges of the periodic box as columns [m]; None without one. The second one is replaced by that of the
        same lattice that leans least, so a shear strain follows from `box_rate`, not from the edges
    box_rate : (2, 2) its velocity gradient at the end of the last step [1/s], whose deformation gradient is
        (1 - dt box_rate)^-1 whatever its length; None without one
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
    nodal_velocity: Array = field(default_factory=lambda: np.zeros(0))
    step_control: StepControl = field(default_factory=StepControl)
    box: Array | None = None
    box_rate: Array | None = None
    derived: Derived | None = field(default=None, repr=False, compare=False)

    @property
    def grids(self) -> Derived:
        """The body grids and what is on them; ValueError in a state without grids, as one of a file."""
        if self.derived is None:
            raise ValueError("the state has no body grids; pass it through `regridded_state` first")
        return self.derived

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
        cx, cy = centres(self.x, self.mass, self.body)
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
