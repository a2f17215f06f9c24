"""The state of a scene, with its contacts."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np

from skmpm.arrays import Array, Bools, Ints
from skmpm.grid.assembly import Assembly
from skmpm.grid.supports import Elimination
from skmpm.representation import line, quantity, table, with_shapes
from skmpm.scene.prescribed import centres
from skmpm.scene.report import Report, StepControl
from skmpm.values import text_and_attributes

MOST_BODIES = 2**32  # of a scene, so that pairs of them have numbers


@dataclass(frozen=True, eq=False, repr=False)
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
    lasting_force : (k,) [N/m] the normal force between the two bodies, or its mean over the steps in which waves
        cross the contact, where these are short; it tells light contacts from wide ones (`contact.closest_points`).
        By default the former
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
    lasting_force: Array = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        if self.lasting_force.shape != self.gap.shape:
            object.__setattr__(self, "lasting_force", between_bodies(self.bodies, self.force[0]))

    def among(self, chosen: Bools | Ints) -> Contacts:
        """Some of the contacts.

        Parameters
        ----------
        chosen : (k,) which, or the indices of them (j,)

        Returns
        -------
        these contacts, (j,)
        """
        return Contacts(**{f.name: getattr(self, f.name)[..., chosen] for f in fields(self)})

    def at(self, side: int) -> Array:
        """Contact points where the first or the second bodies are.

        Parameters
        ----------
        side : 0 for the first bodies, 1 for the second

        Returns
        -------
        (2, k) [m]
        """
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


def pair_numbers(bodies: Ints) -> Ints:
    """Numbers (k,) by which pairs of bodies (2, k) differ, whichever comes first; walls are -1, -2, ..."""
    return np.asarray(np.minimum(*bodies) * MOST_BODIES + np.maximum(*bodies))


def between_bodies(bodies: Ints, force: Array) -> Array:
    """Sums (k,) of the forces (k,) of all contacts between the same two bodies (2, k)."""
    pair = np.unique(pair_numbers(bodies), return_inverse=True)[1]
    return np.asarray(np.bincount(pair, force)[pair])


class StepFailed(RuntimeError):  # noqa: N818  (public name)
    """A step that failed.

    Attributes
    ----------
    state : the last good state
    problem : which criterion failed, where and why
    remedy : what may help beside a smaller dt; empty if nothing else is known
    retryable : whether a smaller dt may help
    retries : number of attempts with longer dt

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> scene = skmpm.Scene([body], cell=4e-4, loads=[skmpm.Load(lambda x: x[1] > 0, (0, 1e3))])
    >>> try:
    ...     skmpm.step(scene, skmpm.initial(scene), 1e-3, scheme=skmpm.Scheme(max_newton=1))
    ... except skmpm.StepFailed as error:
    ...     print(error.state.t, error.retryable)
    0.0 True
    """

    def __init__(
        self,
        problem: str,
        state: State,
        *,
        remedy: str = "",
        retryable: bool = True,
        retries: int = 0,
        tried: str = "",
    ) -> None:
        shorter = "use a smaller dt" if retryable and not tried else ""
        advice = ", or ".join(each for each in (shorter, remedy) if each)
        super().__init__("; ".join(each for each in (problem, advice, tried) if each))
        self.problem, self.state, self.remedy = problem, state, remedy
        self.retryable, self.retries = retryable, retries

    __reduce__ = text_and_attributes


@dataclass(frozen=True, eq=False, repr=False)
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
    mass : (n,) masses of the points [kg/m]
    volume : (n,) current volumes of the points [m2]
    weight : (n,) current quadrature weights of the points [m2]
    internal : (k, n) internal variables of materials with memory, in the order of their `state0`; zero where a
        material has fewer, (0, n) if none has any
    body : (n,) body of each point
    x_anchor : (2, n) positions when the body grids were built [m]
    F_anchor : (2, 2, n) deformation gradients then
    stress_anchor : (2, 2, n) stress then [Pa]
    displacement : (2 nodes,) displacements of the nodes since the body grids were built [m]
    nodal_velocity : (2 nodes,) velocities of the nodes [m/s]. Bodies go on from them unless v or C of their points
        were changed; then from the points, as where it is empty, for new body grids
    walls : (walls, 2) a point of each wall [m]
    wall_normals : (walls, 2) unit, towards the free side
    wall_force : (walls, 2) force of the bodies on each wall in the last step [N/m]
    wall_velocity : (walls, 2) velocities of walls that a force drives; of others in the last step [m/s]
    support_force : (supports, 2) force of the bodies on each support in the last step [N/m]
    support_moment : (supports,) moment of these forces about the centres of supports that turn, zero for others [N]
    box : (2, 2) edges of the periodic box as columns [m], (2, 1) of one that is periodic in one direction; None
        without one. The second one is replaced by that of the same lattice that leans least, so a shear strain
        follows from `box_rate`, not from the edges
    box_rate : (2, 2) velocity gradient of the box at the end of the last step [1/s], whose deformation gradient is (1
        - dt box_rate)^-1 whatever its length; None without one
    contacts : contacts at the end of the last step, `Contacts`
    report : cost and residuals of the last step, a `Report`
    wetted : (pressures, segments) whether each `Pressure` acted on the boundary segments in the last step; (0, 0)
        where none penetrates
    step_control : record of the choice of steps, with which `simulate` continues
    factored : factorised matrix that later steps use again, `Factored`; None if it is made anew
    derived : cached data that follow from the rest

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> scene = skmpm.Scene([body], cell=4e-4, gravity=(0, -9.81))
    >>> state = skmpm.step(scene, skmpm.initial(scene), 1e-3)
    >>> state.t, state.x.shape, state.F.shape
    (0.001, (2, 110), (2, 2, 110))
    >>> round(float(state.v[1].mean()), 5)
    -0.00981
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
    support_moment: Array = field(default_factory=lambda: np.zeros(0))
    nodal_velocity: Array = field(default_factory=lambda: np.zeros(0))
    wetted: Bools = field(default_factory=lambda: np.zeros((0, 0), dtype=bool))
    step_control: StepControl = field(default_factory=StepControl)
    box: Array | None = None
    box_rate: Array | None = None
    factored: Factored | None = field(default=None, repr=False, compare=False)
    derived: Derived | None = field(default=None, repr=False, compare=False)

    @property
    def grids(self) -> Derived:
        """The body grids and what is on them; ValueError in a state without grids, as one of a file."""
        if self.derived is None:
            raise ValueError("the state has no body grids; pass it through `regridded_state` first")
        return self.derived

    @property
    def centres(self) -> Array:
        """Centres of mass of all bodies, (2, bodies) [m]."""
        return centres(self.x, self.mass, self.body)

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
        cx, cy = self.centres
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


@dataclass(frozen=True, eq=False)
class Factored:
    """A matrix that was factorised in an earlier step: its factor follows from this."""

    theta_dt: float  # [s]
    inertia: bool  # whether the step had it
    displacement: Array  # (2 nodes,) of its configuration [m]
    in_contact: bool  # whether bodies touched
    points: Bools  # (m,) contact points whose responses are known


@dataclass(frozen=True)
class Derived:
    """Cached data that follow from the rest of the state; not saved, rebuilt on demand."""

    assembly: Assembly
    ghost: Array  # (cells,) moduli of the ghost penalty in `assembly` [Pa]
    moment_fitting: bool  # whether the weights in `assembly` are fitted
    supports: Elimination | None  # of the unknowns that supports determine
    supporting: Ints  # (2, n) the support that prescribes each component of the points' velocities, -1 where none
    configuration: object = None  # `step.terms.Configuration` of the bodies at the displacement of the state, or None
    of_materials: tuple[object, ...] = ()  # what the configuration depends on besides
