"""Solution of the contact problem: Newton's method, and the proximal point method around it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from skmpm.arrays import EXACT, Array
from skmpm.coulomb.newton import full_steps
from skmpm.coulomb.problem import Bilateral, Iterate, Matrix, Problem, is_sparse, scaled, unscaled

# Weight of the proximal term over diag(W~), which is one: at first, and its factors after success and failure. Larger
# first weights and slower decreases take longer; smaller weights leave problems of rigid bodies unsolved. The least
# is `EXACT`: with less the impulses of a jam become so large that their residual is lost in round-off. With half
# of any factor, here and below, or of the limit test_contact_solver fails.
FIRST_WEIGHT, WEIGHT_DECREASE, WEIGHT_INCREASE = 1.0, 0.3, 5.0
REDUCTION = 0.7  # factor by which each proximal problem must reduce the residual; with 1 a fifth is unsolved
STALL_LIMIT = 150  # stop when this many Newton steps have not halved the residual


@dataclass(frozen=True)
class Info:
    """Statistics of a solve.

    Attributes
    ----------
    iterations : Newton steps
    residual : residual of the natural map, relative to ``|q~|`` or to `reference`
    converged : whether that is within the tolerance
    bilateral : the bilateral unknowns, (m,)

    Examples
    --------
    >>> import numpy as np
    >>> import skmpm
    >>> W = np.diag([2.0, 4.0])  # [1/kg], one contact: normal, tangential
    >>> impulses, info = skmpm.coulomb.solve(W, q=np.array([-1.0, 3.0]), mu=np.array([0.4]))
    >>> info.converged, info.residual < 1e-6, len(info.bilateral)
    (True, True, 0)
    """

    iterations: int
    residual: float
    converged: bool
    bilateral: Array = field(default_factory=lambda: np.zeros(0), compare=False)


def solve(
    W: Any,
    q: ArrayLike,
    mu: ArrayLike,
    *,
    r0: ArrayLike | None = None,
    tol: float = 1e-6,
    iterations: int = 600,
    bilateral: Bilateral | None = None,
    reference: float | None = None,
    repeated: bool = False,
) -> tuple[Array, Info]:
    """Find impulses r such that every contact with u = W r + q obeys Signorini's and Coulomb's laws.

    Parameters
    ----------
    W : (2k, 2k) or (k, k) sparse or dense, symmetric positive semi-definite [1/kg], with `bilateral` m rows more
    q : (2k,) or (k,) relative velocities in the absence of impulses, plus gap / dt on the normal rows [m/s]
    mu : (k,) friction coefficients; a contact with mu = 0 has no tangential unknown
    r0 : like q, initial impulses [N s]
    tol : largest residual relative to ``|q~|``, or to `reference`
    iterations : largest number of Newton steps; below 150, for problems that need not be solved, only full steps from
        r0 are tried
    bilateral : further unknowns without a cone that are coupled with the impulses
    reference : value that residuals are relative to, instead of ``|q~|``, as in `residual`
    repeated : whether the problem is one of many of a time step: a large one is solved roughly while many contacts
        change their states; one of up to 200 rows takes two Newton steps at least, which makes impulses in directions
        that W hardly resists far more accurate than the residual tells

    Returns
    -------
    r : like q, impulses [N s]
    info : number of steps, residual, and whether the solver converged

    Raises
    ------
    ValueError
        if sizes disagree, a friction coefficient is negative, or mu > 0 without tangential rows

    Notes
    -----
    Full steps of a semismooth Newton method (Alart & Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353-375)
    begin with the contact states of r0. Where they fail, because W is singular or nearly singular, problems with a
    proximal term are solved, whose matrix is definite, one after another. The solver stops when `residual` is below
    ``tol |q~|``, never on the size of an increment; tangential rows of frictionless contacts do not count in q~.
    ``info.converged`` is False, and r the best iterate, if ``iterations`` Newton steps do not suffice or 150 of them
    do not halve the residual. The usual reason is that no solution exists (a rigid jam). If W is singular, r is one
    of many solutions. Round-off, about ``1e-16 |W~| |r~|``, bounds the residual from below.

    Examples
    --------
    >>> import numpy as np
    >>> import skmpm
    >>> W = np.diag([2.0, 4.0])  # [1/kg], one contact: normal, tangential
    >>> impulses, info = skmpm.coulomb.solve(W, q=np.array([-1.0, 3.0]), mu=np.array([0.4]))
    >>> impulses.round(3).tolist()
    [0.5, -0.2]
    >>> info.converged
    True
    """
    q, mu = np.asarray(q, dtype=float), np.asarray(mu, dtype=float)
    r0 = np.asarray(np.zeros_like(q) if r0 is None else r0, dtype=float)
    _check(W, q, mu, r0, 0 if bilateral is None else bilateral.q.size)
    if not q.size:
        return np.zeros_like(q), Info(0, 0.0, True)
    with np.errstate(all="ignore"):  # without a solution r may overflow, which the residual shows
        return _solve(W, q, mu, r0, tol, iterations, bilateral, reference, repeated)


def _solve(
    W: Any,
    q: Array,
    mu: Array,
    r0: Array,
    tol: float,
    iterations: int,
    bilateral: Bilateral | None,
    reference: float | None,
    repeated: bool,
) -> tuple[Array, Info]:
    """`solve` for valid arguments: in scaled variables, with the bilateral unknowns after those of the contacts."""
    k = q.size
    if bilateral is not None:
        q = np.concatenate([q, bilateral.q])
        r0 = np.concatenate([r0, np.zeros(q.size - k)])
    problem, s = scaled(W, q, mu, k, reference)
    problem = replace(problem, negative=None if bilateral is None else bilateral.negative, repeated=repeated)
    start = problem.at(problem.clip_to_cone(s * r0))
    best, steps = full_steps(problem, start, tol, iterations)
    if iterations >= STALL_LIMIT:
        best, steps = _proximal(problem, best, tol, iterations, steps)
    r = unscaled(best.r[:k], best.u[:k], problem.mu, s[:k], mu)
    return r, Info(steps, best.error, best.error <= tol, best.r[k:] / s[k:])


def _proximal(p: Problem, x: Iterate, tol: float, limit: int, steps: int) -> tuple[Iterate, int]:
    """Proximal point method (Rockafellar, SIAM J. Control Optim. 14 (1976) 877-898) from x, found in so many steps.

    The matrices W + weight I are definite even if W is singular, and fixed points of the iteration are solutions. The
    smaller the weight, the fewer problems are needed and the harder each is for Newton's method. Returns the best
    iterate and the number of Newton steps.
    """
    best, weight, mark, marked = x, FIRST_WEIGHT, x.error, steps
    while tol < best.error < np.inf and steps < limit and steps - marked < STALL_LIMIT:
        near, wanted = p.near(x.r, weight), max(REDUCTION * x.error, 0.3 * tol)
        new, count = full_steps(near, near.at(x.r), wanted, limit - steps)
        solved, steps = new.error <= wanted, steps + max(count, 1)  # 0 at the limit of round-off
        candidate = p.at(new.r)
        x = candidate if solved or candidate.error < x.error else x
        best = x if x.error < best.error else best
        weight = max(weight * (WEIGHT_DECREASE if solved else WEIGHT_INCREASE), EXACT)
        if best.error < 0.5 * mark:
            mark, marked = best.error, steps
    return best, steps


def _check(W: Matrix, q: Array, mu: Array, r0: Array, more: int) -> None:
    shape, k = W.shape if is_sparse(W) else np.shape(W), mu.size
    square = (q.size + more, q.size + more)
    if mu.ndim != 1 or q.shape not in ((k,), (2 * k,)) or shape != square or r0.shape != q.shape:
        raise ValueError(
            f"sizes disagree: W {shape}, q {q.shape}, mu {mu.shape}, r0 {r0.shape}; "
            "use (2k, 2k), (2k,), (k,), (2k,), or without friction (k, k), (k,), (k,), (k,)"
        )
    if more and not k:
        raise ValueError(f"{more} bilateral unknowns and no contact; solve W s + q = 0 by a linear solver")
    if k and mu.min() < 0.0:
        raise ValueError(f"friction {mu.min():g} is negative; use mu >= 0")
    if k and q.size == k and mu.max() > 0.0:
        raise ValueError(
            f"friction {mu.max():g} but no tangential rows; use W ({2 * k}, {2 * k}), rows n, t per contact"
        )
