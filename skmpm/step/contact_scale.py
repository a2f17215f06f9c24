"""Reference magnitudes of contact residuals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skmpm import coulomb
from skmpm.arrays import Array, Ints
from skmpm.contact import Constraints
from skmpm.contact.constraints import lookup


@dataclass(frozen=True)
class ContactScale:
    """What makes contact residuals dimensionless, from the last contact solve."""

    key: Ints  # (k,) contacts of that solve
    diagonal: Array  # (2, k) of W, positive [1/kg]
    reference: float  # norm of the scaled right-hand side of closing contacts

    def diagonal_of(self, constraints: Constraints) -> Array:
        """The diagonal of W for other contacts, with the median for those that the last solve did not contain."""
        typical = np.median(self.diagonal, axis=1, keepdims=True)
        diagonal = lookup(self.key, self.diagonal, constraints.key, typical)
        return diagonal.T.ravel() if constraints.tangential else diagonal[0]


# Smallest residual asked of the contact solver, over the norm of the right-hand side. Round-off is 1e-13 where soft
# springs hold bodies; with 1e-12 three of four quasi-static runs whose `contact_tol` is 1e-11 fail.
LEAST_RESIDUAL = 1e-11
# [cells] A step without inertia moves no body farther, beyond what prescribed motions move. One falls by 4 cells, but
# not by 8 (test_equilibrium).
FARTHEST = 6.0


def contact_scale(
    constraints: Constraints,
    diagonal: Array,
    q: Array,
    round_off: float,
    dt: float,
    tol: float = 1.0,
    farthest: float = np.inf,
) -> ContactScale:
    """The scale of a contact problem with diag W and right-hand side q; `round_off` is the smallest speed [m/s].

    Residuals of `tol` times the reference must be more than round-off. Speeds above `farthest` [m/s] count as that
    much: without inertia, bodies would move thousands of cells on soft springs in W without contact, and gaps and
    slips are to be small beside cells.

    Open contacts do not count, since their gaps are not related to the size of the forces. Sliding speeds count as
    far as friction can change them: not at all where a support prescribes the tangential velocity. Cohesive contacts
    that open count as far as their tension in dt [s] can prevent it. Nor do contacts count whose diagonal of W is
    negative, which an indefinite matrix of a body may give one of thousands; the solver scales them by its magnitude.
    """
    responds = diagonal.reshape(constraints.size, -1).T > 0.0
    scaled = coulomb.row_scales(diagonal, constraints.size)
    responds[1:] &= (scaled == diagonal).reshape(constraints.size, -1).T[1:]
    scale = np.abs(scaled.reshape(constraints.size, -1).T[[0, -1]])
    speed = np.abs(q).reshape(constraints.size, -1).T  # (1 or 2, k)
    tension = dt * constraints.tensile_strength * scale[0]
    normal = q[:: len(speed)]
    closing = speed.copy()
    closing[0] = np.where(normal < 0.0, speed[0], np.minimum(speed[0], tension))
    pressed = np.maximum(tension - normal, 0.0)
    closing[1:] = np.minimum(speed[1:], constraints.friction * pressed * (scale[1] / scale[0]))
    free, held = (
        float(np.linalg.norm(np.where(responds, np.maximum(each, round_off) / np.sqrt(scale[: len(speed)]), 0.0)))
        for each in (closing, np.minimum(closing, farthest))
    )
    return ContactScale(constraints.key, scale, max(held, LEAST_RESIDUAL / tol * free, 1e-300))
