"""One implicit step of all bodies: Newton's method on the incremental potential with frictional contact.

The unknown w (n,) is the velocity that moves the points, w = theta v1 + (1 - theta) v0: of the nodes, then of what
has no grid (`scalar_unknowns`). Without contact it minimises

    E(w) = 1/2 |w - v0|_M^2 + sum_p V_p W(I + grad(U + theta dt w)) + 1/2 |U + theta dt w|_G^2 - theta dt f.w

over the nodal velocities that satisfy the supports: M lumped mass, U the nodal displacement, W the strain energy
density, G the ghost penalty, f gravity and loads. The anchor is the reference configuration: that in which the body
grids were last built. U, deformation gradients and volumes V_p are relative to it (`Scheme.anchor`).

With contact, grad E = theta H^T r and (r, u = H w + offset) satisfy Signorini's and Coulomb's laws, which are solved
exactly in every Newton iteration with the matrix A = M + theta^2 dt^2 K. A static step solves the same problem
several times, with a metric for M, each time about the solution before (`statics`).
"""

from skmpm.implicit.budget import Budget
from skmpm.implicit.bulk import Bulk
from skmpm.implicit.configuration import Configuration
from skmpm.implicit.contact_problem import ContactIterate, ContactProblem, KnownForces
from skmpm.implicit.end import End, carried, end_of_step
from skmpm.implicit.errors import StepRejected, pair
from skmpm.implicit.gauge import Gauge, gauge_of
from skmpm.implicit.iteration import Solution
from skmpm.implicit.loads import DeadLoad, FollowerPressure
from skmpm.implicit.newton import advance
from skmpm.implicit.residual import Increment
from skmpm.implicit.scalar_unknowns import Inertia, ScalarUnknowns
from skmpm.implicit.springs import Bars, Beds
from skmpm.implicit.statics import settle
from skmpm.implicit.terms import Path, Term
from skmpm.implicit.timer import Timer
from skmpm.implicit.viscous import ViscousBulk

__all__ = [
    "Bars",
    "Beds",
    "Budget",
    "Bulk",
    "Configuration",
    "ContactIterate",
    "ContactProblem",
    "DeadLoad",
    "End",
    "FollowerPressure",
    "Gauge",
    "Increment",
    "Inertia",
    "KnownForces",
    "Path",
    "ScalarUnknowns",
    "Solution",
    "StepRejected",
    "Term",
    "Timer",
    "ViscousBulk",
    "advance",
    "carried",
    "end_of_step",
    "gauge_of",
    "pair",
    "settle",
]
