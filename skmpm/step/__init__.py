"""One implicit step of all bodies: Newton's method on the incremental potential with frictional contact.

`initial` makes the first state, `step` advances it (`algorithm`); `skmpm.simulation` has the loop around `step`.

The unknown w (n,) is the velocity that moves the points, w = theta v1 + (1 - theta) v0: of the nodes, then of what
has no grid (`scalar_unknowns`). Without contact it minimises

    E(w) = 1/2 |w - v0|_M^2 + sum_p V_p W(I + grad(U + theta dt w)) + 1/2 |U + theta dt w|_G^2 - theta dt f.w

over the nodal velocities that satisfy the supports: M lumped mass, U the nodal displacement, W the strain energy
density, G the ghost penalty, f gravity and loads. The anchor is the reference configuration: that in which the body
grids were last built. U, deformation gradients and quadrature weights V_p are relative to it (`Scheme.anchor`).

Round bodies on which no friction acts keep their angular momentum as a condition (`gauge`): else their material may
turn inside their shape at no cost.

With contact, grad E = theta H^T r and (r, u = H w + offset) satisfy Signorini's and Coulomb's laws, which are solved
exactly in every Newton iteration with the matrix A = M + theta^2 dt^2 K. A static step solves the same problem
several times, with a metric for M, each time about the solution before (`statics`).
"""

from skmpm.step.algorithm import step
from skmpm.step.initial_state import initial

__all__ = ["initial", "step"]
