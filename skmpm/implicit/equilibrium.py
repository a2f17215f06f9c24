"""Whether contacts can carry the loads of rigid bodies, and the motion that begins where they cannot.

Bodies that nothing but contact holds are in equilibrium only if contact forces r within their Coulomb cones, r_n >= 0
and |r_t| <= mu r_n, balance the loads f of their rigid motions: f + J' r = 0, J the rows n and t of relative
velocities. By Farkas' lemma there are none if and only if there is a motion q with

    f . q > 0    and    n . Jq >= mu |t . Jq|   at every contact,

along which the loads do work and no contact resists: in the plane, where the cones are polyhedra, a linear programme
(Livesley, Int. J. Numer. Methods Eng. 12 (1978) 1853-1871). Without such forces there is no equilibrium whatever the
flow rule of friction, which the programme takes for an associated one, and however bodies deform at these contacts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

SHARE = 1e-3  # of a body's load: what is less is within the default tolerance of the balance
LIGHTEST = 1e-2  # of the largest load: lighter bodies count as that heavy, or the others would hardly move
STILL = 1e-3  # of the fastest motion: what moves less counts as at rest where motions get names


@dataclass(frozen=True)
class Joints:
    """The contacts of n rigid bodies, each with the unknowns vx, vy and spin times its radius, body after body."""

    bodies: Ints  # (2, k); fixed ones are negative
    normal: sp.csr_array  # (k, 3 n) to relative velocities, first less second body, along the contacts' normals
    tangent: sp.csr_array  # (k, 3 n) along their tangents
    friction: Array  # (k,) Coulomb coefficients
    held: sp.csr_array  # (m, 3 n) combinations of velocities that supports stop

    @property
    def resisting(self) -> sp.csr_array:
        """Rows that are not negative in any motion: n - mu t and n + mu t, one of them where there is no friction."""
        rough = np.flatnonzero(self.friction > 0.0)
        slope = sp.diags_array(self.friction[rough]) @ self.tangent[rough]
        smooth = self.normal[np.flatnonzero(self.friction == 0.0)]
        return sp.csr_array(sp.vstack([smooth, self.normal[rough] - slope, self.normal[rough] + slope]))


def mechanism(load: Array, joints: Joints, *, few: bool = False) -> Array | None:
    """A motion (3 n,) that the loads (3 n,) drive and nothing resists; None if contacts can carry all but `SHARE`.

    In units in which every body's load is one: of all motions whose unknowns are at most one, or with `few` are at
    most one together, so that few bodies move, that along which the loads do most work. The largest unknown is one.
    """
    size = np.abs(load.reshape(-1, 3)).max(axis=1)
    if not size.any():
        return None
    unit = np.repeat(1.0 / np.maximum(size, LIGHTEST * size.max()), 3)
    rows = [_scaled(sp.csr_array(r @ sp.diags_array(unit))) for r in (joints.resisting, joints.held)]
    q = (_fewest if few else _fastest)(load * unit, *rows)
    if q is None or float(load * unit @ q) <= SHARE:  # a programme that fails decides nothing
        return None
    return np.asarray(q * unit / np.abs(q * unit).max())


def _fastest(work: Array, resisting: sp.csr_array, held: sp.csr_array) -> Array | None:
    """Maximise work.q where resisting q >= 0, held q = 0, |q| <= 1."""
    return _maximised(work, -resisting, np.zeros(resisting.shape[0]), held, (-1.0, 1.0))


def _fewest(work: Array, resisting: sp.csr_array, held: sp.csr_array) -> Array | None:
    """Maximise work.q where resisting q >= 0, held q = 0, sum |q| <= 1; q is a difference of positive vectors."""
    signed = [sp.csr_array(sp.hstack([rows, -rows])) for rows in (resisting, held)]
    limits = sp.csr_array(sp.vstack([-signed[0], sp.csr_array(np.ones((1, 2 * work.size)))]))
    found = _maximised(
        np.r_[work, -work], limits, np.append(np.zeros(resisting.shape[0]), 1.0), signed[1], (0.0, None)
    )
    return None if found is None else np.asarray(found[: work.size] - found[work.size :])


def _maximised(
    work: Array, limits: sp.csr_array, most: Array, held: sp.csr_array, bounds: tuple[float, float | None]
) -> Array | None:
    """Maximise work.x where limits x <= most, held x = 0; None where HiGHS does not."""
    from scipy.optimize import linprog  # only here: most runs never need it

    given: Any = {"A_ub": limits, "b_ub": most, "A_eq": held, "b_eq": np.zeros(held.shape[0]), "bounds": bounds}
    x = linprog(-work, method="highs", **given).x
    return None if x is None else np.asarray(x, dtype=float)


def _scaled(rows: sp.csr_array) -> sp.csr_array:
    """Rows over their largest entries, without those of zeros."""
    largest = abs(rows).max(axis=1).toarray().ravel() if rows.shape[0] else np.zeros(0)
    kept = np.flatnonzero(largest > 0.0)
    return sp.csr_array(sp.diags_array(1.0 / largest[kept]) @ rows[kept])


@dataclass(frozen=True)
class Motion:
    """What one of several bodies does where they move."""

    body: int
    verb: str
    contact: int  # of the joints where it does so, -1 where there is none


def motion(q: Array, joints: Joints) -> Motion:
    """What the motion q (3 n,) is, told by a body that moves against something that does not."""
    speed = np.abs(q.reshape(-1, 3)).max(axis=1)
    moves = speed > STILL * speed.max()
    apart, along = joints.normal @ q, joints.tangent @ q
    stays = ~np.append(moves, False)[joints.bodies]  # (2, k); fixed bodies are the last
    fastest = np.append(speed, 0.0)[joints.bodies].max(axis=0)
    closed = apart <= joints.friction * np.abs(along) + STILL * fastest
    closed = np.flatnonzero(closed & (stays.sum(axis=0) == 1))
    if closed.size == 0:
        b = int(np.argmax(speed))
        touches = (joints.bodies == b).any()
        return Motion(b, "leaves all that it touches" if touches else "falls with nothing near it", -1)
    slides = np.abs(along[closed]) > STILL * fastest[closed]
    i = int(closed[np.argmax(slides)])
    b = int(joints.bodies[:, i][~stays[:, i]][0])
    turns = abs(q[3 * b + 2]) > STILL * speed[b]
    if slides.any():
        return Motion(b, "slides and turns" if turns else "slides", i)
    return Motion(b, "turns" if turns else "moves", i)
