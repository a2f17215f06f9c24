"""Limit analysis of rigid bodies in frictional contact: equilibrium, or a collapse mechanism.

Bodies with rigid-body modes free of supports are in equilibrium only if contact forces r within their Coulomb cones,
r_n >= 0 and |r_t| <= mu r_n, balance the resultants f of the loads along these modes: f + J^T r = 0, with the contact
Jacobian J of rows n and t. By Farkas' lemma there are no such forces if and only if there is a mechanism, a
rigid-body motion q with

    f . q > 0    and    n . Jq >= mu |t . Jq|   at every contact,

along which the loads do positive work and admissible contact forces do no negative work, r . Jq >= 0, so that they
cannot balance the loads. In the plane, where the cones are polyhedra, it follows
from a linear programme (Livesley, Int. J. Numer. Methods Eng. 12 (1978) 1853-1871). The programme takes friction as
associated; a mechanism excludes equilibrium for any flow rule, and however the bodies deform at these contacts.
Cohesion shifts the cones by the tensile strengths p, r_n >= -p and |r_t| <= mu (r_n + p): the same programme with the
loads f - J_n^T p, against which a mechanism that opens contacts does work.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

LOAD_TOLERANCE = 1e-3  # out-of-balance load over the load of a body, as the default tolerance of Newton's method
MIN_LOAD = 1e-2  # over the largest load: lighter bodies are scaled as if this heavy, or the others would hardly move
REST_SPEED = 1e-3  # over the fastest motion: slower motions count as rest in messages


@dataclass(frozen=True)
class RigidContacts:
    """The contacts of n rigid bodies, each with the unknowns vx, vy and spin times radius, body after body."""

    bodies: Ints  # (2, k); negative for bodies that do not move
    normal: sp.csr_array  # (k, 3 n) contact Jacobian, first minus second body, normal
    tangent: sp.csr_array  # (k, 3 n) the same, tangential
    friction: Array  # (k,) Coulomb coefficients
    supports: sp.csr_array  # (m, 3 n) rows whose products with the velocities supports set to zero
    tensile_strength: Array | None = None  # (k,) tension that contacts bear [N/m]

    @property
    def resisting(self) -> sp.csr_array:
        """Rows that must not be negative in a mechanism: n - mu t and n + mu t, or n without friction."""
        frictional = np.flatnonzero(self.friction > 0.0)
        normal = self.normal[frictional]
        tangential = sp.diags_array(self.friction[frictional]) @ self.tangent[frictional]
        frictionless = self.normal[np.flatnonzero(self.friction == 0.0)]
        return sp.csr_array(sp.vstack([frictionless, normal - tangential, normal + tangential]))


def mechanism(load: Array, contacts: RigidContacts, *, few: bool = False) -> Array | None:
    """A mechanism (3 n,) under the loads (3 n,), its largest unknown one; None if contacts can carry the loads.

    It maximises the work of the loads, in units in which every body's load is one, over all motions with a bounded
    maximum norm, or with `few` a bounded 1-norm, so that few bodies move. The loads count as carried to
    `LOAD_TOLERANCE`.
    """
    size = np.abs(load.reshape(-1, 3)).max(axis=1)
    if not size.any():
        return None
    unit = np.repeat(1.0 / np.maximum(size, MIN_LOAD * size.max()), 3)
    rows = [_scaled(sp.csr_array(r @ sp.diags_array(unit))) for r in (contacts.resisting, contacts.supports)]
    strength = contacts.tensile_strength
    work = load * unit if strength is None else (load - contacts.normal.T @ strength) * unit
    q = (_fewest if few else _fastest)(work, *rows)
    if q is None or float(work @ q) <= LOAD_TOLERANCE:  # no conclusion if the programme fails
        return None
    return np.asarray(q * unit / np.abs(q * unit).max())


def _fastest(work: Array, resisting: sp.csr_array, supports: sp.csr_array) -> Array | None:
    """Maximise work.q subject to resisting q >= 0, supports q = 0, |q| <= 1."""
    return _maximised(work, -resisting, np.zeros(resisting.shape[0]), supports, (-1.0, 1.0))


def _fewest(work: Array, resisting: sp.csr_array, supports: sp.csr_array) -> Array | None:
    """Maximise work.q subject to resisting q >= 0, supports q = 0, sum |q| <= 1, with q = q+ - q-."""
    signed = [sp.csr_array(sp.hstack([rows, -rows])) for rows in (resisting, supports)]
    upper = sp.csr_array(sp.vstack([-signed[0], sp.csr_array(np.ones((1, 2 * work.size)))]))
    found = _maximised(
        np.r_[work, -work], upper, np.append(np.zeros(resisting.shape[0]), 1.0), signed[1], (0.0, None)
    )
    return None if found is None else np.asarray(found[: work.size] - found[work.size :])


def _maximised(
    work: Array, upper: sp.csr_array, b: Array, equal: sp.csr_array, bounds: tuple[float, float | None]
) -> Array | None:
    """Maximise work.x subject to upper x <= b, equal x = 0; None if HiGHS finds no solution."""
    from scipy.optimize import linprog  # imported here, since most runs do not need it

    programme: Any = {"A_ub": upper, "b_ub": b, "A_eq": equal, "b_eq": np.zeros(equal.shape[0]), "bounds": bounds}
    x = linprog(-work, method="highs", **programme).x
    return None if x is None else np.asarray(x, dtype=float)


def _scaled(rows: sp.csr_array) -> sp.csr_array:
    """Rows divided by their largest entries, without zero rows."""
    largest = abs(rows).max(axis=1).toarray().ravel() if rows.shape[0] else np.zeros(0)
    kept = np.flatnonzero(largest > 0.0)
    return sp.csr_array(sp.diags_array(1.0 / largest[kept]) @ rows[kept])


@dataclass(frozen=True)
class MechanismDescription:
    """The motion of one body in a mechanism, for error messages."""

    body: int
    verb: str  # "slides", "rotates", ...
    contact: int  # index of the contact at which it moves, -1 if there is none


def describe(q: Array, contacts: RigidContacts) -> MechanismDescription:
    """Describe the mechanism q (3 n,) by a body that moves in contact with one at rest."""
    speed = np.abs(q.reshape(-1, 3)).max(axis=1)
    moves = speed > REST_SPEED * speed.max()
    opening, sliding = contacts.normal @ q, contacts.tangent @ q
    at_rest = ~np.append(moves, False)[contacts.bodies]  # (2, k); the last entry stands for fixed bodies
    fastest = np.append(speed, 0.0)[contacts.bodies].max(axis=0)
    closed = opening <= contacts.friction * np.abs(sliding) + REST_SPEED * fastest
    closed = np.flatnonzero(closed & (at_rest.sum(axis=0) == 1))
    if closed.size == 0:
        b = int(np.argmax(speed))
        touches = (contacts.bodies == b).any()
        return MechanismDescription(
            b, "separates from all that it touches" if touches else "falls with no contact nearby", -1
        )
    slides = np.abs(sliding[closed]) > REST_SPEED * fastest[closed]
    i = int(closed[np.argmax(slides)])
    b = int(contacts.bodies[:, i][~at_rest[:, i]][0])
    rotates = abs(q[3 * b + 2]) > REST_SPEED * speed[b]
    if slides.any():
        return MechanismDescription(b, "slides and rotates" if rotates else "slides", i)
    return MechanismDescription(b, "rotates" if rotates else "moves", i)
