"""Signorini-Coulomb contact in the plane: impulses r and relative velocities u = W r + q, W the Delassus operator.

Each contact obeys ``0 <= r_n  perp  u_n >= 0`` and ``|r_t| <= mu r_n``, where r_t opposes u_t if the contact slips
(Jean, Comput. Methods Appl. Mech. Eng. 177 (1999) 235-257). Rows are interleaved, n0, t0, n1, t1, ...; a problem
without friction has no t rows. The solver works in variables scaled by diag(W), which are of order one whatever the
mass or stiffness at a contact: r~ = sqrt(diag W) r, u~ = u / sqrt(diag W). Friction cones stay cones, with
mu~ = mu sqrt(W_tt / W_nn). Tangential rows without response are scaled like their normal rows (`row_scales`).
The package depends on matrices and friction coefficients only, not on grids or bodies.
"""

from skmpm.coulomb.problem import MAX_DENSE_ROWS, Bilateral, project, residual, residuals, row_scales
from skmpm.coulomb.search import Info, solve

__all__ = ["MAX_DENSE_ROWS", "Bilateral", "Info", "project", "residual", "residuals", "row_scales", "solve"]
