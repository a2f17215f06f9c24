"""Whether bodies vibrate: what tells a load that they follow from one that sets them in motion."""

from __future__ import annotations

from skmpm.scene import Scene, State, centres, fitted_motions, velocity_at
from skmpm.simulate.driven import without_supports

# Kinetic over elastic energy from which on waves matter. A vibration of amplitude a about a static displacement u has
# (a / u)^2, so that one of 3 % is left to the damping of long steps; under a load that grows from zero, vibrations
# that begin with it are smaller than that after five of their periods.
VIBRATING = 1e-3


def vibrates(scene: Scene, state: State) -> bool:
    """Whether the kinetic energy of deformation is not small beside the elastic energy.

    Velocities are those relative to the rigid motions of bodies, with supports those that their points have.
    """
    motions = fitted_motions(state.x, state.v, state.mass, state.body) * without_supports(scene)
    arm = state.x - centres(state.x, state.mass, state.body)[:, state.body]
    relative = state.v - velocity_at(arm, motions[:, state.body])
    kinetic = 0.5 * float(state.mass @ (relative**2).sum(axis=0))
    return kinetic > VIBRATING * state.report.energy.elastic
