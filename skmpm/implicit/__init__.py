"""One implicit step of all bodies: Newton on the incremental potential, contact solved exactly in every iteration.

The unknown w (2 nodes,) is the velocity that moves the points, w = theta v1 + (1 - theta) v0. Without contact it
minimises

    E(w) = 1/2 |w - v0|_M^2 + sum_p V_p W(I + grad(U + theta dt w)) + 1/2 |U + theta dt w|_G^2 - theta dt f.w

over the nodal velocities that supports admit: M lumped mass, U the displacement since anchoring, W the material's
energy, G the ghost penalty, f gravity and loads. With contact, grad E = theta H' r and (r, u = H w + offset) obey
Signorini's and Coulomb's laws. A quasi-static step has no first term; where nothing but contact holds a body, springs
in A, and in A only, keep each Newton iteration from sending it away: they carry nothing once it is in equilibrium.
"""

from skmpm.implicit.bulk import Bulk, Configuration
from skmpm.implicit.contact_problem import ContactProblem, Timer
from skmpm.implicit.errors import NotConverged
from skmpm.implicit.iteration import Solution
from skmpm.implicit.residual import End, Increment
from skmpm.implicit.statics import advance

__all__ = [
    "Bulk",
    "Configuration",
    "ContactProblem",
    "End",
    "Increment",
    "NotConverged",
    "Solution",
    "Timer",
    "advance",
]
