"""`moduli`: the elastic moduli of a packing in a periodic box, by small static strains."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from skmpm.arrays import ROUND_OFF, Array, Bools
from skmpm.observe import observe
from skmpm.representation import line, quantity
from skmpm.scene import Periodic, Scene, SceneError, State, StepFailed, at_rest, check_fits, check_scene
from skmpm.scheme import Scheme
from skmpm.step.algorithm import step
from skmpm.step.driven import prescribed_speeds
from skmpm.values import number

# Stress differences are a hundred-thousandth of the moduli: solves are as much more accurate than in a run.
STATIC = Scheme(inertia=False, newton_tol=1e-8, gap_tol=1e-9, contact_tol=1e-9)
STRAIN, SMALLEST, LARGEST = 1e-5, 1e-7, 1e-2  # by default, and the range in which solves are accurate enough
HELD = 1e3  # coefficient of friction with which no contact slides
STRAINS = (((1.0, 0.0), (0.0, 0.0)), ((0.0, 0.0), (0.0, 1.0)), ((0.0, 0.5), (0.5, 0.0)))


@dataclass(frozen=True, eq=False, repr=False)
class Moduli:
    """The elastic moduli of a packing in the plane; `moduli` defines them.

    Attributes
    ----------
    tensor : (2, 2, 2, 2) C, stress [i, j] over strain [k, l] [Pa]
    bulk : K = (C_xxxx + C_xxyy + C_yyxx + C_yyyy) / 4 [Pa]
    shear : G = C_xyxy [Pa], stress over twice the strain e_xy; that along the box, without rotation
    shear_pure : (C_xxxx - C_xxyy - C_yyxx + C_yyyy) / 4 [Pa], the same at 45 degrees to the box
    stress : (2, 2) stress of the packing at rest, tension positive [Pa]
    rattlers : (bodies,) whether contacts do not hold a body at rest: it bears nothing

    Examples
    --------
    >>> import skmpm
    >>> gel = skmpm.NeoHookean(E=1e6, nu=0.3, density=1000)
    >>> body = skmpm.Body(skmpm.disc((1e-3, 1e-3), 1e-3, spacing=1.5e-4), gel)
    >>> box = skmpm.Periodic(2e-3, 2e-3, rate=((-0.01, 0), (0, -0.01)))
    >>> scene = skmpm.Scene([body], cell=2e-4, friction=0.5, periodic=box)
    >>> *_, state = skmpm.simulate(scene, dt=1.0, until=2.0, scheme=skmpm.Scheme(inertia=False))
    >>> found = skmpm.moduli(scene, state)
    >>> found.tensor.shape, bool(found.rattlers.any())
    ((2, 2, 2, 2), False)
    """

    tensor: Array
    stress: Array
    rattlers: Bools

    def __repr__(self) -> str:
        sizes = {"bulk": self.bulk, "shear": self.shear, "shear_pure": self.shear_pure}
        facts = {f"{name} =": quantity(value, "Pa") for name, value in sizes.items()}
        return line("Moduli", facts | {"rattlers": int(self.rattlers.sum())})

    @property
    def bulk(self) -> float:
        """The bulk modulus [Pa]."""
        C = self.tensor
        return float(C[0, 0, 0, 0] + C[0, 0, 1, 1] + C[1, 1, 0, 0] + C[1, 1, 1, 1]) / 4.0

    @property
    def shear(self) -> float:
        """The shear modulus along the box [Pa]."""
        return float(self.tensor[0, 1, 0, 1])

    @property
    def shear_pure(self) -> float:
        """The shear modulus at 45 degrees to the box [Pa]."""
        C = self.tensor
        return float(C[0, 0, 0, 0] - C[0, 0, 1, 1] - C[1, 1, 0, 0] + C[1, 1, 1, 1]) / 4.0


def moduli(scene: Scene, state: State, *, strain: float = STRAIN, held: bool = False) -> Moduli:
    """Measure the elastic moduli of a packing in a periodic box.

    The packing comes to static equilibrium in the box of the state, which stays. From there the box takes small
    strains e_xx, e_yy and e_xy = e_yx, of both signs, each in a static step from the same state. The moduli are the
    differences of the mean stress of the contact forces over those of the strain. Contacts may slide, open and close
    in these steps; where they do so in one sense only, moduli are the mean of both.

    Parameters
    ----------
    scene, state : a packing in a `Periodic` box; rate and stress of the box and velocities do not matter
    strain : strain of each step; another one tells whether contacts that slide, open or close matter
    held : whether no contact slides, whatever its friction: moduli of the packing as a network. Else friction is that
        of the scene

    Returns
    -------
    the moduli, with the stress and the rattlers of the packing at rest

    Raises
    ------
    SceneError
        if the scene has no periodic box, the state belongs to another scene, the packing bears no pressure, or the
        strain is no number between 1e-7 and 0.01
    StepFailed
        if there is no equilibrium near the state

    Notes
    -----
    The packing is stressed at rest. C is the change of Cauchy stress by a strain without rotation. It lacks the terms
    that would make it symmetric, C_xxyy = C_yyxx, which are of the size of the stress. Compare O'Hern, Silbert, Liu
    & Nagel, Phys. Rev. E 68 (2003) 011306.

    The boundary points that touch stay the same in small strains, so that the modulus of a contact of few of them is
    up to a tenth too large or too small. In a packing contacts differ, and the mean is better.

    Examples
    --------
    >>> import skmpm
    >>> gel = skmpm.NeoHookean(E=1e6, nu=0.3, density=1000)
    >>> body = skmpm.Body(skmpm.disc((1e-3, 1e-3), 1e-3, spacing=1.5e-4), gel)
    >>> box = skmpm.Periodic(2e-3, 2e-3, rate=((-0.01, 0), (0, -0.01)))
    >>> scene = skmpm.Scene([body], cell=2e-4, friction=0.5, periodic=box)
    >>> *_, state = skmpm.simulate(scene, dt=1.0, until=2.0, scheme=skmpm.Scheme(inertia=False))
    >>> found = skmpm.moduli(scene, state)
    >>> f"{found.bulk:.1e}", f"{found.shear:.1e}"
    ('2.9e+05', '1.7e+05')
    """
    check_packing("moduli", scene, state)
    remedy = f"give a strain between {SMALLEST:g} and {LARGEST:g}, as {STRAIN:g}"
    number("moduli: strain", strain, remedy, SMALLEST, LARGEST)
    still = strained(_held(scene) if held else scene, np.zeros((2, 2)))
    rest = _at_rest(still, state)
    seen = observe(still, rest)
    if not seen.pressure > ROUND_OFF * scene.largest_modulus:
        raise SceneError(
            f"moduli: the packing bears no pressure ({seen.pressure:.3g} Pa) in the box of the state; give a packing"
            " under pressure"
        )
    changes = [_change(still, rest, strain * np.array(each)) / (2.0 * strain) for each in STRAINS]
    tensor = np.stack([np.stack([changes[0], changes[2]], axis=-1), np.stack([changes[2], changes[1]], axis=-1)], -1)
    rattlers = np.isnan(seen.bodies.coordination_without_rattlers)
    return Moduli(tensor, _symmetric(seen.stress), rattlers)


def check_packing(name: str, scene: Scene, state: State) -> None:
    """Raise SceneError unless a state is that of a packing in a box that is periodic in both directions."""
    check_scene(name, scene)
    check_fits(scene, state, name)
    if state.box is None or state.box.shape[1] == 1:
        raise SceneError(
            f"{name}: the scene has no box that is periodic in both directions; give Scene(...,"
            " periodic=Periodic(width, height))"
        )
    for what, speed in prescribed_speeds(strained(scene, np.zeros((2, 2))), state.t):
        if speed > 0.0:
            raise SceneError(f"{name}: {what} moves at {speed:.3g} m/s in a packing that is to rest; hold or free it")


def _at_rest(still: Scene, state: State) -> State:
    """The equilibrium in a box that stays: the second, to which contacts have come closer than in the first."""
    try:
        first = step(still, at_rest(still, state), 1.0, scheme=STATIC)
        return step(still, first, 1.0, scheme=STATIC)
    except StepFailed as error:
        problem = f"moduli: no equilibrium was found near the state ({error.problem})"
        remedy = "let it come to rest before, as by `simulate` in a box of rate zero"
        raise StepFailed(problem, error.state, remedy=remedy, retryable=False) from error


def _change(still: Scene, rest: State, strain: Array) -> Array:
    """Stress (2, 2) [Pa] after a strain less that after the opposite one: what a step changes anyway cancels."""
    after, before = (
        _symmetric(observe(still, step(strained(still, sign * strain), rest, 1.0, scheme=STATIC)).stress)
        for sign in (1.0, -1.0)
    )
    return after - before


def strained(scene: Scene, gradient: ArrayLike) -> Scene:
    """The scene with a box that takes a displacement gradient (2, 2) in a second."""
    assert scene.periodic is not None
    return replace(scene, periodic=Periodic(scene.periodic.width, scene.periodic.height, rate=gradient))


def _held(scene: Scene) -> Scene:
    """The scene with so much friction that no contact slides."""
    return replace(scene, bodies=[replace(body, friction=None) for body in scene.bodies], friction=HELD)


def _symmetric(stress: Array) -> Array:
    return 0.5 * (stress + stress.T)
