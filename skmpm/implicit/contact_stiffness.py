"""How the forces of loaded contacts turn: what the geometry of contact adds to A, in contact space.

The gap of a point that slides by tau along a curve whose tangent turns by beta changes, to second order, by

    d2 g = -c (kappa tau^2 + 2 tau beta + g beta^2),    c = 1 / (1 - g kappa),

kappa the curve's curvature, negative where it bulges. A contact with normal impulse r therefore adds Z' D Z to the
Hessian of the Lagrangian, Z the rows of tau and beta, D = theta^2 dt r c [[kappa, 1], [1, g]]: its force turns by
phi = c (kappa tau + beta) and moves along the curve by tau. Friction of slope m = r_t / r does the same where it
slips, and has no potential: phi r m along the normal, which seen from the frame before is phi r m^2 more along the
tangent, and m r tau on the stretch of the curve. A contact that sticks turns nothing: its force is a vector.

All this couples bodies and is not definite, so it stays out of A: the impulses rho = -D Z dw / theta are unknowns of
the contact problem, linear rows with the compliance theta D^-1. They vanish with convergence.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from skmpm.contact import Constraints

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

LOADED = 1e-3  # share of the largest impulse below which a contact turns nothing
LEAST_DISTANCE = 0.1  # smallest 1 - g kappa: the point must not come near the centre of curvature
CONE_TOLERANCE = 1e-9  # share of the edge of a cone by which impulses on it may miss it


@dataclass(frozen=True)
class ContactStiffness:
    """The loaded contacts between bodies that slide, m of them."""

    contacts: Ints  # (m,) places among the rows
    slope: Array  # (m,) of their forces, tangential over normal; zero without friction
    Z: sp.csr_array  # (2 m, 2 places) rows of sliding, then of turning
    acting: sp.csr_array  # (2 m, 2 places) rows along which rho acts: Z but for friction
    compliance: sp.csr_array  # (2 m, 2 m) theta D^-1

    @property
    def size(self) -> int:
        """Number of linear rows."""
        return self.Z.shape[0]

    def rotated_impulses(self, r: Array, rho: Array) -> Array:
        """The impulses (2 k,) along the frames as they have turned, from those along the frames before and rho."""
        i, m, out = self.contacts, self.slope, r.copy()
        normal = r[2 * i] + m / (1.0 + m**2) * rho[: i.size]
        on_edge = np.abs(r[2 * i + 1] - m * r[2 * i]) <= CONE_TOLERANCE * np.abs(m) * r[2 * i]
        slips = on_edge & (np.minimum(normal, r[2 * i]) > 0.0)
        out[2 * i] = np.where(slips, normal, r[2 * i])
        out[2 * i + 1] = np.where(slips, m * normal, r[2 * i + 1])
        return out


def contact_stiffness(constraints: Constraints, r: Array, dt: float, theta: float) -> ContactStiffness | None:
    """What contacts with impulses r turn; None where none does."""
    chosen = loaded(constraints, r)
    if constraints.tangential:
        chosen = chosen[~sticking(r, constraints.friction)[chosen]]
    if chosen.size == 0:
        return None
    normal, slope = r[chosen], np.zeros(chosen.size)
    if constraints.tangential:
        normal = r[2 * chosen]
        slope = r[2 * chosen + 1] / normal
    slide, turn, stretch = constraints.geometric(chosen)
    Z = sp.csr_array(sp.vstack([slide, turn], format="csr"))
    acting = sp.csr_array(sp.vstack([slide, turn + sp.diags_array(slope) @ stretch], format="csr"))
    return ContactStiffness(chosen, slope, Z, acting, _compliance(constraints, chosen, normal, slope, dt, theta))


def _compliance(
    constraints: Constraints, chosen: Ints, normal: Array, slope: Array, dt: float, theta: float
) -> sp.csr_array:
    """Theta D^-1 with the share of friction, (2 m, 2 m)."""
    gap, kappa = constraints.gap[chosen], constraints.curvature[chosen]
    c = 1.0 / np.maximum(1.0 - gap * kappa, LEAST_DISTANCE)
    factor = theta / (theta**2 * dt * normal * c * (gap * kappa - 1.0))
    lean = 1.0 / (1.0 + slope**2)
    entries = ((gap * lean, -np.ones_like(gap)), (-lean, kappa))
    return sp.block_array([[sp.diags_array(factor * e) for e in row] for row in entries], format="csr")


def loaded(constraints: Constraints, r: Array) -> Ints:
    """The contacts on curves that carry a share of the load."""
    normal = r[::2] if constraints.tangential else r
    return np.flatnonzero((normal > LOADED * normal.max(initial=0.0)) & constraints.curved)


def sticking(r: Array, friction: Array) -> NDArray[np.bool_]:
    """Whether impulses (2 k,) are inside their cones, (k,)."""
    return np.asarray(np.abs(r[1::2]) < (1.0 - CONE_TOLERANCE) * friction * r[::2])
