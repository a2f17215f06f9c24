"""The components of a scene: bodies, walls, supports and loads, and their prescribed motions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import cast

import numpy as np
from numpy.typing import ArrayLike

from skmpm.arrays import Array, Ints
from skmpm.material import Material, MaterialWithMemory, Rigid
from skmpm.points import Points
from skmpm.values import Given, components

Motion = Callable[[float], ArrayLike]  # time [s] -> (2,)
Components = Sequence[float | None] | ArrayLike  # of a motion; None is free
Prescribed = Components | Callable[[float], Components]
Part = tuple[Material, Ints | slice]  # a material and its points
Where = Callable[[Array], ArrayLike]  # positions (2, n) [m] at t = 0 -> (n,) bool
Rest = float | ArrayLike | Callable[[float], ArrayLike] | None  # of a spring


@dataclass(frozen=True)
class Body(Given):
    """A cloud of material points of one material, or of several.

    Parameters
    ----------
    points : points and outline
    material : LinearElastic, NeoHookean, MooneyRivlin, Yeoh, Ogden, ElastoPlastic, one of your own (`skmpm.Material`,
        `skmpm.MaterialWithMemory`), or Rigid. A dict from the names of the groups of the points (`Points.group`) to
        materials makes a body of several, as in ``Body(points, {"core": steel, "skin": rubber})``; they are bonded
        where they meet
    velocity : (2,) velocity [m/s] at t = 0, or a function of positions (2, n) -> (2, n), not for `Rigid`; in a
        periodic box in addition to the motion of the box at the centre of mass
    spin : angular velocity about the centre of mass at t = 0 [rad/s], counter-clockwise
    motion : motion of a `Rigid` body that is not free: (vx, vy, spin) [m/s, m/s, rad/s], velocity of the centre of
        mass and angular velocity about it, or a function of time t -> (3,), taken at the middle of each step; (0, 0,
        0) holds it. A component None is free: (0, 0, None) is a wheel on a fixed axle, (v, None, 0) a plate that is
        drawn along and settles. Without it, a rigid body moves by the forces on it, with the mass and moment of
        inertia of its points. A component is free always or never
    friction : Coulomb coefficient of all its contacts that the table of the scene has no entry for; by default that
        of the scene
    name : name of its surface in a table of friction; several bodies may have the same

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> body.points.x.shape
    (2, 110)
    >>> wheel = skmpm.Body(skmpm.disc((0, 3e-3), 1e-3, spacing=2e-4), skmpm.Rigid(density=2000), spin=10.0)
    >>> wheel.spin
    10.0
    >>> idler = skmpm.Body(skmpm.disc((0, 3e-3), 1e-3, spacing=2e-4), skmpm.Rigid(2000.0), motion=(0, 0, None))
    >>> idler.motion[2] is None
    True
    """

    points: Points
    material: Material | MaterialWithMemory | Rigid | Mapping[str, Material | MaterialWithMemory]
    velocity: ArrayLike | Callable[..., ArrayLike] = field(default=(0.0, 0.0), kw_only=True)
    spin: float = field(default=0.0, kw_only=True)
    motion: Prescribed | None = field(default=None, kw_only=True)
    friction: float | None = field(default=None, kw_only=True)
    name: str | None = field(default=None, kw_only=True)

    @property
    def parts(self) -> tuple[Part, ...]:
        """The deformable materials of the body, each with its points; none of a rigid body."""
        if isinstance(self.material, Mapping):
            group = self.points.group
            points = [np.flatnonzero(group == name) for name in self.material]
            return tuple(zip(self.materials, points, strict=True))
        return tuple((material, slice(None)) for material in self.materials)

    @property
    def materials(self) -> tuple[Material, ...]:
        """The deformable materials of the body; none of a rigid body."""
        if isinstance(self.material, Rigid):
            return ()
        given = self.material.values() if isinstance(self.material, Mapping) else (self.material,)
        return cast(tuple[Material, ...], tuple(given))  # those with memory are Materials once bound to a step


@dataclass(frozen=True)
class Wall(Given):
    """A rigid half-plane through `point`; `normal`, of any length, points to the free side.

    It moves with a given velocity or, along its normal, by a force or a pressure; its velocity along the normal is
    then an unknown of the contact problem, in which the force is exact at the end of every step. Across the normal it
    slides with the given velocity, as in tests of friction and of direct shear.

    Parameters
    ----------
    point : (2,) a point of the wall [m] at t = 0
    normal : (2,) direction to the free side, of any length
    velocity : (2,) velocity [m/s] or a function of time t -> (2,), taken at the middle of each step; its part along
        the normal of a driven wall counts only where the wall begins, at t = 0 or in a stage
    force : force that drives the wall towards the bodies [N/m], a number or a function of time, taken at t + theta dt
        of each step from t on
    pressure : pressure that drives it instead of a force, over the length of the wall between the other walls [Pa]
    mass : mass of a driven wall [kg/m]; by default that of all bodies which forces move. Without inertia it has none
    friction : Coulomb coefficient of all its contacts that the table of the scene has no entry for; by default that
        of the scene
    cohesion : tension that contacts with bodies bear [Pa], see `Scene`
    name : name of its surface in a table of friction; several walls may have the same

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> floor = skmpm.Wall((0, -1e-3), (0, 1))
    >>> scene = skmpm.Scene([body], cell=4e-4, walls=[floor], gravity=(0, -9.81))
    >>> *_, state = skmpm.simulate(scene, dt=1e-3, until=2e-2)
    >>> weight = 9.81 * state.mass.sum()
    >>> round(float(state.wall_force[0, 1] / weight), 2)
    -1.0
    """

    point: ArrayLike
    normal: ArrayLike
    velocity: ArrayLike | Motion = field(default=(0.0, 0.0), kw_only=True)
    force: float | Callable[[float], float] | None = field(default=None, kw_only=True)
    pressure: float | Callable[[float], float] | None = field(default=None, kw_only=True)
    mass: float | None = field(default=None, kw_only=True)
    friction: float | None = field(default=None, kw_only=True)
    cohesion: float = field(default=0.0, kw_only=True)
    name: str | None = field(default=None, kw_only=True)

    @property
    def driven(self) -> bool:
        """Whether a force or a pressure drives the wall."""
        return self.force is not None or self.pressure is not None


@dataclass(frozen=True)
class Support(Given):
    """A prescribed velocity or displacement of the points of deformable bodies where `where(x)` is true at t = 0.

    It has no effect on rigid bodies whose motion is prescribed whole, and is refused at points of others.

    Parameters
    ----------
    where : function of positions (2, n) [m] -> (n,) bool
    velocity : (2,) velocity [m/s] or a function of time t -> (2,), taken at the middle of each step; a component None
        is free
    displacement : instead of a velocity, a function of time t -> (2,) [m], zero at t = 0; it holds at the ends of
        steps, whatever their length. A support that is added in a later stage moves its points by the change of the
        function from then on
    rotation : a function of time t -> angle [rad], counter-clockwise and zero at t = 0, by which the points turn
        about `centre`, as a hub or a clamp does; it holds at the ends of steps. The velocity or displacement is added
        to it, and may then have no free component. `State.support_moment` is the moment
    centre : (2,) centre of rotation at t = 0 [m]; by default the mean of the points

    Examples
    --------
    >>> import numpy as np
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> hold = skmpm.Support(lambda x: x[1] > 0)
    >>> scene = skmpm.Scene([body], cell=4e-4, supports=[hold], gravity=(0, -9.81))
    >>> state = skmpm.step(scene, skmpm.initial(scene), 1.0, scheme=skmpm.Scheme(inertia=False))
    >>> weight = 9.81 * state.mass.sum()
    >>> round(float(state.support_force[0, 1] / weight), 2)
    -1.0
    >>> tube = skmpm.Body(skmpm.ring((0, 0), 1e-3, 2e-3, spacing=1.5e-4), body.material)
    >>> rim, hub = lambda x: np.hypot(*x) > 1.99e-3, lambda x: np.hypot(*x) < 1.01e-3
    >>> turned = [skmpm.Support(rim), skmpm.Support(hub, rotation=lambda t: 0.01 * t)]
    >>> scene = skmpm.Scene([tube], cell=2e-4, supports=turned)
    >>> state = skmpm.step(scene, skmpm.initial(scene), 1.0, scheme=skmpm.Scheme(inertia=False))
    >>> bool(state.support_moment[1] < 0)  # the body resists
    True
    """

    where: Where
    velocity: Prescribed = field(default=(0.0, 0.0), kw_only=True)
    displacement: Callable[[float], Components] | None = field(default=None, kw_only=True)
    rotation: Callable[[float], float] | None = field(default=None, kw_only=True)
    centre: ArrayLike | None = field(default=None, kw_only=True)

    @property
    def prescribed(self) -> Prescribed:
        """What prescribes the motion: the displacement, else the velocity."""
        return self.velocity if self.displacement is None else self.displacement


@dataclass(frozen=True)
class Load(Given):
    """A dead load on the points of bodies that forces move where `where(x)` is true at t = 0.

    It is spread by boundary length if only boundary points match, else by volume. On a rigid body it acts by its
    resultant and its moment, which changes as the body turns.

    Parameters
    ----------
    where : function of positions (2, n) [m] -> (n,) bool
    force : (2,) total force [N/m] or a function of time t -> (2,), taken at t + theta dt of each step from t on

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> pull = skmpm.Load(lambda x: x[1] > 0, (0, 0.1))
    >>> scene = skmpm.Scene([body], cell=4e-4, loads=[pull])
    >>> state = skmpm.step(scene, skmpm.initial(scene), 1e-4)
    >>> round(float((state.mass * state.v[1]).sum() / 1e-4), 3)
    0.1
    """

    where: Where
    force: ArrayLike | Motion


@dataclass(frozen=True)
class Pressure(Given):
    """A pressure on the boundary of deformable bodies where `where(x)` is true at t = 0; it follows the normals.

    It acts on the segments between boundary points at both of which `where` is true; at points of free rigid
    bodies it may not be.

    The pressure of a fluid that `penetrates` acts where it gets to along the boundaries of these bodies, from the
    points where `where` is true: up to points that a support holds, and up to contacts that press more than it does,
    as both are at the start of each step. It leaves contacts that press as much without it. What has got through a
    leak stays, so close a seal before the fluid comes. `wetted` returns where it acts. It does not press on walls and
    other bodies.

    Parameters
    ----------
    where : function of positions (2, n) [m] -> (n,) bool
    value : pressure [Pa], or a function of time t -> a number, taken at t + theta dt of each step from t on; negative
        for suction, but not with `penetrates`
    penetrates : whether it follows contact

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> hydrostatic = skmpm.Pressure(lambda x: x[0] < 1, 1e4)
    >>> scene = skmpm.Scene([body], cell=4e-4, loads=[hydrostatic])
    >>> state = skmpm.step(scene, skmpm.initial(scene), 1.0, scheme=skmpm.Scheme(inertia=False))
    >>> bool(state.volume.sum() < body.points.volume.sum())
    True
    """

    where: Where
    value: float | Callable[[float], float]
    penetrates: bool = field(default=False, kw_only=True)


@dataclass(frozen=True)
class Spring(Given):
    """A linear spring on the points of deformable bodies where `where(x)` is true at t = 0.

    Without `to` it is a bed to ground: every point is held at its position at t = 0 by a share of the stiffness, by
    boundary length if only boundary points match, else by volume. It resists rotation, too. With `to` it is a bar
    between the means of two sets of points, weighted alike, or from one to a fixed point: its force
    stiffness * (length - rest) acts along it, whatever it turns to. The force is exact at t + theta dt of each step.
    Neither `where` nor `to` may be true at points of free rigid bodies.

    Parameters
    ----------
    where : function of positions (2, n) [m] -> (n,) bool
    stiffness : total stiffness, force per displacement and per metre of thickness [N/m2]; of a bed a number or (2,),
        one per direction, of which one may be zero
    to : the other end of a bar: positions (2, n) -> (n,) bool, or a point (2,) [m]
    rest : rest position: of a bed the displacement (2,) [m] without a force, by default zero; of a bar the length [m]
        without a force, by default that at t = 0. A number, or a function of time: its end then moves

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> bed = skmpm.Spring(lambda x: x[1] < 0, stiffness=1e3)
    >>> scene = skmpm.Scene([body], cell=4e-4, springs=[bed], gravity=(0, -9.81))
    >>> state = skmpm.step(scene, skmpm.initial(scene), 1.0, scheme=skmpm.Scheme(inertia=False))
    >>> round(float(skmpm.spring_forces(scene, state)[0, 1]), 4)
    0.0308
    """

    where: Where
    stiffness: float | Sequence[float]
    to: Where | ArrayLike | None = field(default=None, kw_only=True)
    rest: Rest = field(default=None, kw_only=True)


def rigid_motion(body: Body, t: float, name: str) -> Array:
    """Prescribed velocity of the centre of mass and angular velocity of a rigid body at time t, (3,) [m/s, rad/s].

    Components that are free are nan.

    Raises
    ------
    SceneError
        if it is not three components, each a finite number or None
    """
    if body.motion is None:
        return np.full(3, np.nan)
    name = f"{name}: motion at t = {t:.6g} s" if callable(body.motion) else f"{name}: motion"
    remedy = "give (vx, vy, spin), each a finite number or None, or no motion for a body that forces move"
    return components(name, body.motion(t) if callable(body.motion) else body.motion, 3, remedy)
