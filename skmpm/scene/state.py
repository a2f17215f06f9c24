"""Where a scene stands: the state, and what the last step reports."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from skmpm.assembly import Assembly
    from skmpm.constraint_elimination import Elimination
    from skmpm.linear import Delassus, Solver

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class StepFailed(RuntimeError):  # noqa: N818  (the public name says what happened)
    """A step that did not converge; `state` is the last good one, `retryable` whether a smaller dt may help."""

    def __init__(self, message: str, state: State, *, retryable: bool = True) -> None:
        super().__init__(message)
        self.state, self.retryable = state, retryable


@dataclass(frozen=True)
class Contacts:
    """The contacts at the end of a step; walls are bodies -1, -2, ..."""

    bodies: Ints  # (2, k)
    x: Array  # (2, k) [m]
    normal: Array  # (2, k) unit, from the second to the first body
    force: Array  # (2, k) [N/m] on the first body, in (n, t), t = (-n_y, n_x)
    gap: Array  # (k,) [m]
    key: Ints  # (k,) identity of a contact from step to step: the warm start
    point: Ints  # (k,) material point of the first body on whose boundary the contact lies; -1 at a grid node

    @staticmethod
    def none() -> Contacts:
        """No contact at all."""
        ints, floats = np.zeros((2, 0), dtype=np.int64), np.zeros((2, 0))
        return Contacts(ints, floats, floats, floats, floats[0], ints[0], ints[0])


@dataclass(frozen=True)
class Energy:
    """The energy budget [J/m]; what is not kinetic or elastic is a sum since t = 0."""

    kinetic: float = 0.0
    elastic: float = 0.0  # with the ghost penalty's share
    external: float = 0.0  # work of gravity, loads, walls and supports
    push_out: float = 0.0  # work of contacts that remove an overlap left by an earlier step
    regridded: float = 0.0  # what regridding made of the points' energy, more or less
    viscous: float = 0.0  # dissipated by the viscosity of materials
    dissipated: float = 0.0  # what is missing: friction, impacts, the time scheme, the transfer


@dataclass(frozen=True)
class StepControl:
    """How far `simulate` has halved its steps after a failure: the next one is dt / 2^halvings."""

    dt: float = 0.0  # [s] the full step that was asked for
    halvings: int = 0
    successes: int = 0  # good steps in a row since the last failure or growth
    part: int = 0  # of the full step that is being made, in 1/1024 of it


@dataclass(frozen=True)
class Report:
    """What a step cost and how good it is."""

    dt: float = 0.0  # length of the step [s]
    retries: int = 0  # failures of longer steps before this one
    newton: int = 0  # Newton iterations
    factorisations: int = 0  # factorisations of A
    contact: int = 0  # iterations of the contact solver, all Newton iterations together
    residual: float = 0.0  # natural-map residual of the contact law at the end of the step
    imbalance: float = 0.0  # residual of the momentum balance over the largest of its terms
    frozen_normals: bool = False  # whether contact normals are those of an earlier Newton iteration
    overlap: float = 0.0  # area shared by bodies / area of all bodies
    energy: Energy = Energy()
    seconds: dict[str, float] = field(default_factory=dict)  # by phase


@dataclass(frozen=True)
class State:
    """All that a restart needs; arrays are read-only by convention."""

    t: float  # [s]
    x: Array  # (2, n) positions [m]
    v: Array  # (2, n) velocities [m/s]
    F: Array  # (2, 2, n) deformation gradients
    C: Array  # (2, 2, n) affine velocity (APIC), by anchor position [1/s]
    stress: Array  # (2, 2, n) elastic Cauchy stress [Pa], tension positive; without what viscosity adds
    mass: Array  # (n,) [kg/m]
    volume: Array  # (n,) current [m2]
    weight: Array  # (n,) current volumes that the points stand for in integrals over their cells [m2]
    body: Ints  # (n,)
    x_anchor: Array  # (2, n) positions when the body grids were built [m]
    F_anchor: Array  # (2, 2, n)
    stress_anchor: Array  # (2, 2, n) [Pa]
    displacement: Array  # (2 nodes,) of the nodes since then [m]
    walls: Array  # (walls, 2) a point of each wall [m]
    wall_normals: Array  # (walls, 2) unit, into the free side
    wall_force: Array  # (walls, 2) exerted by the bodies in the last step [N/m]
    support_force: Array  # (supports, 2) the same on each support
    contacts: Contacts
    report: Report
    step_control: StepControl = StepControl()
    derived: Derived | None = field(default=None, repr=False, compare=False)


@dataclass(frozen=True)
class Derived:
    """Kept for speed; follows from the rest of the state, is not saved and is rebuilt on demand."""

    assembly: Assembly
    ghost: Array  # (bodies,) moduli of the ghost penalty in `assembly` [Pa]
    moment_fitting: bool  # whether the weights in `assembly` are
    supports: Elimination | None  # of the unknowns that supports fix
    supporting: Ints  # (2, n) the support that fixes each component of the points' velocities, -1 where none does
    key: tuple[object, ...] = ()  # what the kept solver was made for
    solver: Solver | None = None
    delassus: Delassus | None = None  # of the places of contacts, by this solver
