"""Signorini-Coulomb contact in the plane: impulses r and velocities u = W r + q; no grid is known here.

Per contact ``0 <= r_n  perp  u_n >= 0`` and ``|r_t| <= mu r_n``, r_t against u_t where it slips (Jean,
Comput. Methods Appl. Mech. Eng. 177 (1999) 235-257). Rows are interleaved, n0, t0, n1, t1, ...; a problem
without friction leaves the t rows out. All work is done in variables scaled by diag(W), which are O(1)
however light or stiff a contact point is: r~ = sqrt(diag W) r, u~ = u / sqrt(diag W); a cone stays a cone,
with mu~ = mu sqrt(W_tt / W_nn). Tangential rows that do not respond take the scale of their normal row: `row_scales`.
"""

from skmpm.coulomb.law import project, residual, residuals, row_scales
from skmpm.coulomb.problem import Bilateral
from skmpm.coulomb.search import Info, solve

__all__ = ["Bilateral", "Info", "project", "residual", "residuals", "row_scales", "solve"]
