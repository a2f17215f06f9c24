"""What is simulated (Scene) and where it stands (State), with the checks that speak to the user."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skmpm.material import LinearElastic, Material, NeoHookean, Rigid
from skmpm.outline import Outlines, area, outlines, overlap
from skmpm.points import Points
from skmpm.points import check as check_points

if TYPE_CHECKING:
    from skmpm.assembly import Assembly
    from skmpm.linear import Solver

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Motion = Callable[[float], ArrayLike]  # time [s] -> (2,)
Field = Callable[[Array], ArrayLike]  # positions (2, n) [m] -> (2, n)


class SceneError(ValueError):
    """A scene that cannot be simulated: names the object, the value and the remedy."""


class StepFailed(RuntimeError):  # noqa: N818  (the public name says what happened)
    """A step that did not converge; `state` is the last good one."""

    def __init__(self, message: str, state: State) -> None:
        super().__init__(message)
        self.state = state


@dataclass(frozen=True)
class Body:
    """A cloud of material points of one material.

    Parameters
    ----------
    points : its points and outline
    material : LinearElastic, NeoHookean or Rigid
    velocity : (2,) [m/s], or a function of positions (2, n) -> (2, n) at t = 0; for `Rigid` (2,) or a function of
        time t -> (2,) for the whole run
    spin : initial angular velocity about the centre of mass [rad/s], counter-clockwise
    """

    points: Points
    material: Material
    velocity: ArrayLike | Callable[..., ArrayLike] = field(default=(0.0, 0.0), kw_only=True)
    spin: float = field(default=0.0, kw_only=True)


@dataclass(frozen=True)
class Wall:
    """A rigid half-plane through `point`; the unit `normal` points into the free side.

    Parameters
    ----------
    point : (2,) [m] at t = 0
    normal : (2,)
    velocity : (2,) [m/s] or a function of time t -> (2,)
    friction : Coulomb coefficient against every body
    """

    point: ArrayLike
    normal: ArrayLike
    velocity: ArrayLike | Motion = field(default=(0.0, 0.0), kw_only=True)
    friction: float = field(default=0.0, kw_only=True)


@dataclass(frozen=True)
class Scene:
    """Bodies and walls on a background grid of square cells.

    Parameters
    ----------
    bodies : the bodies
    cell : side h of the cells [m]
    walls : rigid half-planes
    friction : Coulomb coefficient between bodies
    gravity : (2,) [m/s2], or a function of initial positions X (2, n) and time t -> (2, n)

    Raises
    ------
    SceneError
        on bad input, naming the object, its value and the remedy
    """

    bodies: Sequence[Body]
    cell: float = field(kw_only=True)
    walls: Sequence[Wall] = field(default=(), kw_only=True)
    friction: float = field(default=0.0, kw_only=True)
    gravity: ArrayLike | Callable[[Array, float], ArrayLike] = field(default=(0.0, 0.0), kw_only=True)

    def __post_init__(self) -> None:
        object.__setattr__(self, "bodies", tuple(self.bodies))
        object.__setattr__(self, "walls", tuple(self.walls))
        check(self)

    @property
    def offsets(self) -> Ints:
        """Where each body's points begin in the arrays of a state, (bodies + 1,)."""
        return np.concatenate([[0], np.cumsum([body.points.x.shape[1] for body in self.bodies])]).astype(int)

    @property
    def deformable(self) -> NDArray[np.bool_]:
        """Which bodies have unknowns, (bodies,)."""
        return np.array([not isinstance(body.material, Rigid) for body in self.bodies], dtype=bool)

    @property
    def outlines(self) -> Outlines:
        """The outlines of all bodies, as indices into the arrays of a state."""
        return outlines([body.points.outline for body in self.bodies], self.offsets)

    @property
    def normals(self) -> Array:
        """Unit normals of the walls, (2, walls)."""
        return np.array([wall.normal for wall in self.walls], dtype=float).reshape(-1, 2).T

    def wall_velocities(self, t: float) -> Array:
        """Velocities of the walls at time t, (walls, 2) [m/s]."""
        return np.array([motion(wall.velocity, t) for wall in self.walls]).reshape(-1, 2)


@dataclass(frozen=True)
class Contacts:
    """The contacts at the end of a step; walls are bodies -1, -2, ..."""

    bodies: Ints  # (2, k)
    x: Array  # (2, k) [m]
    normal: Array  # (2, k) unit, from the second to the first body
    force: Array  # (2, k) [N/m] on the first body, in (n, t), t = (-n_y, n_x)
    gap: Array  # (k,) [m]
    key: Ints  # (k,) identity of a contact from step to step: the warm start
    point: Ints  # (k,) material point of the first body on whose rim the contact lies; -1 at a grid node

    @staticmethod
    def none() -> Contacts:
        """No contact at all."""
        ints, floats = np.zeros((2, 0), dtype=np.int64), np.zeros((2, 0))
        return Contacts(ints, floats, floats, floats, floats[0], ints[0], ints[0])


@dataclass(frozen=True)
class Energy:
    """The energy budget [J/m]; the last three are sums since t = 0."""

    kinetic: float = 0.0
    elastic: float = 0.0  # with the ghost penalty's share
    external: float = 0.0  # work of gravity and walls
    push_out: float = 0.0  # work of contacts that remove an overlap left by an earlier step
    dissipated: float = 0.0  # what is missing: friction, impacts, the time scheme, the transfer


@dataclass(frozen=True)
class Report:
    """What a step cost and how good it is."""

    newton: int = 0  # Newton iterations
    linear: int = 0  # factorisations of A
    contact: int = 0  # iterations of the contact solver, all Newton iterations together
    residual: float = 0.0  # natural-map residual of the contact law at the end of the step
    imbalance: float = 0.0  # residual of the momentum balance over the largest of its terms
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
    stress: Array  # (2, 2, n) Cauchy stress [Pa], tension positive
    mass: Array  # (n,) [kg/m]
    volume: Array  # (n,) current [m2]
    body: Ints  # (n,)
    x_anchor: Array  # (2, n) positions when the sheets were laid [m]
    F_anchor: Array  # (2, 2, n)
    stress_anchor: Array  # (2, 2, n) [Pa]
    displacement: Array  # (2 nodes,) of the nodes since then [m]
    walls: Array  # (walls, 2) a point of each wall [m]
    wall_force: Array  # (walls, 2) exerted by the bodies in the last step [N/m]
    contacts: Contacts
    report: Report
    derived: Derived | None = field(default=None, repr=False, compare=False)


@dataclass(frozen=True)
class Derived:
    """Kept for speed; follows from the rest of the state, is not saved and is rebuilt on demand."""

    assembly: Assembly
    key: tuple[object, ...] = ()  # what the kept solver was made for
    solver: Solver | None = None


def motion(velocity: ArrayLike | Callable[..., ArrayLike], t: float) -> Array:
    """A prescribed velocity (2,) at time t, from a constant or a function of time."""
    return np.asarray(velocity(t) if callable(velocity) else velocity, dtype=float)


def check(scene: Scene) -> None:
    """Raise SceneError on the first thing in the scene that cannot be simulated."""
    if not scene.bodies:
        raise SceneError("the scene has no bodies; give at least one Body")
    _positive("cell", scene.cell, "a cell size in metres, about a fifth of the smallest radius")
    _friction("friction between bodies", scene.friction)
    if not callable(scene.gravity):
        _vector("gravity", scene.gravity)
    for i, body in enumerate(scene.bodies):
        _check_body(f"body {i}", body)
    for i, wall in enumerate(scene.walls):
        _check_wall(f"wall {i}", wall)
    _check_start(scene)


def _check_body(name: str, body: Body) -> None:
    if not isinstance(body.points, Points):
        raise SceneError(f"{name}: points is {body.points!r}; use skmpm.Points, disc, box or from_mesh")
    problem = check_points(body.points)
    if problem:
        raise SceneError(f"{name}: {problem}")
    material = body.material
    if not isinstance(material, LinearElastic | NeoHookean | Rigid):
        raise SceneError(f"{name}: material is {material!r}; use LinearElastic, NeoHookean or Rigid")
    _positive(f"{name}: density", material.density, "a density in kg/m3")
    if not isinstance(material, Rigid):
        _positive(f"{name}: Young's modulus E", material.E, "a modulus in Pa")
        if not (np.isfinite(material.nu) and -1.0 < material.nu < 0.5):
            raise SceneError(f"{name}: Poisson's ratio nu = {material.nu}; it lies between -1 and 0.5, both excluded")
    if not callable(body.velocity):
        _vector(f"{name}: velocity", body.velocity)
    elif isinstance(material, Rigid):
        _vector(f"{name}: velocity(0)", body.velocity(0.0))
    else:
        v = np.asarray(body.velocity(body.points.x), dtype=float)
        if v.shape != body.points.x.shape or not np.isfinite(v).all():
            raise SceneError(
                f"{name}: velocity(x) has shape {v.shape} or is not finite; return {body.points.x.shape}"
            )
    if not np.isfinite(body.spin):
        raise SceneError(f"{name}: spin = {body.spin}; give a finite angular velocity in rad/s")


def _check_wall(name: str, wall: Wall) -> None:
    _vector(f"{name}: point", wall.point)
    _vector(f"{name}: normal", wall.normal)
    length = float(np.linalg.norm(np.asarray(wall.normal, dtype=float)))
    if abs(length - 1.0) > 1e-9:
        raise SceneError(
            f"{name}: normal = {np.asarray(wall.normal)} has length {length:.6g}; divide it by its length"
        )
    _vector(f"{name}: velocity", motion(wall.velocity, 0.0))
    _friction(f"{name}: friction", wall.friction)


def _check_start(scene: Scene, tolerance: float = 1e-3) -> None:
    """Bodies may touch at the start, but neither overlap nor be cut by a wall by more than `tolerance` cells."""
    slack = tolerance * scene.cell
    for i, wall in enumerate(scene.walls):
        normal, point = np.asarray(wall.normal, dtype=float), np.asarray(wall.point, dtype=float)
        for b, body in enumerate(scene.bodies):
            depth = -float((normal @ (body.points.x - point[:, None])).min())
            if depth > slack and not isinstance(body.material, Rigid):
                raise SceneError(
                    f"wall {i} cuts body {b}: a point lies {depth:.3g} m behind it; move the wall or the body"
                )
    rim = scene.outlines
    if rim.point.size == 0:
        return
    x = np.concatenate([body.points.x for body in scene.bodies], axis=1)[:, rim.point]
    first = _first_overlap(scene, rim, x, slack)
    if first is not None:
        a, b, depth = first
        raise SceneError(
            f"bodies {a} and {b} overlap at the start: a rim point lies about {depth:.3g} m inside;"
            " move them apart or shrink them"
        )


def _first_overlap(scene: Scene, rim: Outlines, x: Array, slack: float) -> tuple[int, int, float] | None:
    pairs, shared = overlap(rim, x, len(scene.bodies))
    if not shared.size:
        return None
    size = area(rim, x, len(scene.bodies))
    # A lens of depth d between bodies of size L has an area of about d^1.5 L^0.5.
    length = np.sqrt(np.minimum(size[pairs[0]], size[pairs[1]]))
    depth = (np.maximum(shared, 0.0) / np.sqrt(length)) ** (2.0 / 3.0)
    worst = int(np.argmax(depth))
    if depth[worst] <= slack:
        return None
    return int(pairs[0, worst]), int(pairs[1, worst]), float(depth[worst])


def _positive(name: str, value: float, what: str) -> None:
    if not (np.isfinite(value) and value > 0.0):
        raise SceneError(f"{name} = {value}; give {what}, greater than zero")


def _friction(name: str, value: float) -> None:
    if not (np.isfinite(value) and value >= 0.0):
        raise SceneError(f"{name} = {value}; give a Coulomb coefficient of zero or more")


def _vector(name: str, value: ArrayLike) -> None:
    array = np.asarray(value, dtype=float)
    if array.shape != (2,) or not np.isfinite(array).all():
        raise SceneError(f"{name} = {array}; give two finite numbers (x, y)")
