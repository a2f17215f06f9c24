"""Every accuracy-for-speed choice in one frozen dataclass."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from numbers import Real
from typing import Any

import numpy as np

from skmpm import linear as _linear
from skmpm.arrays import ROUND_OFF
from skmpm.contact import ContactFormulation, acts_at_grid_nodes, point_to_curve, shared_grid
from skmpm.linear import Linear
from skmpm.material import Material, has_memory, poisson_ratio

# Poisson's ratio from which Q1 cells lock (`tests/verification/test_mean_dilatation.py`).
NEARLY_INCOMPRESSIBLE = 0.4


@dataclass(frozen=True, kw_only=True, repr=False)
class Scheme:
    """How a scene is solved; the defaults are `Scheme.balanced()`, the optimum of docs/studies/work_precision.md.

    Parameters
    ----------
    theta : Moreau-Jean parameter in [1/2, 1]: 1 is backward Euler, 1/2 the midpoint rule
    anchor : regrid when the strain or rotation since the last regridding, ``max |F - I|``, exceeds this; inf: never
        (total Lagrangian), 0: at every step (updated Lagrangian, as in Nezamabadi et al. 2017)
    contact : contact formulation: `contact.point_to_curve`, `contact.shared_grid` or another formulation
        (`skmpm.contact`)
    ghost : gamma, the coefficient of the ghost penalty on cells of which less than 0.6 is filled, relative to the
        elastic modulus
    inertia : whether bodies have inertia; without it steps are quasi-static, which requires theta = 1
    moment_fitting : fit the weights of points, and the places at which their strains are evaluated, to the exact
        moments of their cell's material inside the outline; False: use the points and their volumes as they are
    mean_dilatation : average the change of volume over cells, so that nearly incompressible bodies do not lock:
        True for all, False for none, None for those with a Poisson's ratio of 0.4 or more (`NEARLY_INCOMPRESSIBLE`)
        and those with memory, since plastic flow conserves volume
    newton_tol : largest imbalance of momentum relative to its largest term, both as norms over all nodes; the
        relative error of the force on a body is larger where this force is small beside the forces within bodies
    contact_tol : largest natural-map residual of a contact solve, relative to the velocities at which contacts would
        close without their forces
    gap_tol : largest natural-map residual of the contact law with the gaps at the end of the step, relative to the
        motion that contact prevents or, where forces drive walls without inertia, to the deformation
    linear : linear solver: `linear.banded`, `linear.amg`, `linear.direct` or `linear.default`, which selects one by
        size
    max_newton : Newton iterations after which a step fails; with contact it fails earlier, after
        twenty that came no closer to convergence, but for static steps of held bodies
    threads : number of threads among which bodies are divided; None: one for each core that the process may use.
        Results do not depend on it

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> scene = skmpm.Scene([body], cell=4e-4, gravity=(0, -9.81))
    >>> scheme = skmpm.Scheme(theta=0.5)
    >>> state = skmpm.step(scene, skmpm.initial(scene), 1e-3, scheme=scheme)
    >>> round(float(state.v[1].mean()), 5)
    -0.00981
    """

    theta: float = 1.0
    anchor: float = float("inf")
    contact: ContactFormulation = field(default=point_to_curve)
    ghost: float = 0.005
    moment_fitting: bool = True
    mean_dilatation: bool | None = None
    inertia: bool = True
    newton_tol: float = 1e-3
    contact_tol: float = 1e-6
    gap_tol: float = 1e-5
    linear: Linear = field(default=_linear.default)
    max_newton: int = 60
    threads: int | None = field(default=None, compare=False)  # no result depends on it

    def __post_init__(self) -> None:
        limits = {
            "theta": (0.5, 1.0, "between 1/2 (midpoint) and 1 (backward Euler)"),
            "anchor": (0.0, float("inf"), "0 (every step), a bound, or inf (never)"),
            "ghost": (0.0, 1.0, "about 0.005"),
            "newton_tol": (1e-14, 1e-1, "about 1e-3"),
            "contact_tol": (1e-14, 1e-1, "about 1e-6"),
            "gap_tol": (1e-14, 1e-1, "about 1e-5"),
            "max_newton": (1, 10_000, "about 60"),
        }
        for name, (low, high, remedy) in limits.items():
            value = getattr(self, name)
            if not isinstance(value, Real) or not low <= float(value) <= high:
                raise ValueError(f"Scheme: {name} = {value!r}; use {remedy}")
        if self.max_newton != int(self.max_newton):
            raise ValueError(f"Scheme: max_newton = {self.max_newton!r}; use a whole number")
        if self.threads is not None and not (isinstance(self.threads, int | np.integer) and self.threads >= 1):
            raise ValueError(f"Scheme: threads = {self.threads!r}; use a number of at least 1, or None for all cores")
        for name in ("moment_fitting", "inertia"):
            if getattr(self, name) not in (False, True):
                raise ValueError(f"Scheme: {name} = {getattr(self, name)!r}; use True or False")
        if self.mean_dilatation not in (None, False, True):
            raise ValueError(
                f"Scheme: mean_dilatation = {self.mean_dilatation!r}; use True, False, or None (by the material)"
            )
        for name in ("moment_fitting", "inertia", "mean_dilatation"):  # of numpy, or 0 and 1
            if getattr(self, name) is not None:
                object.__setattr__(self, name, bool(getattr(self, name)))
        if self.gap_tol < self.contact_tol:
            raise ValueError(
                f"Scheme: gap_tol = {self.gap_tol} is below contact_tol = {self.contact_tol}, the residual of a"
                " contact solve; raise gap_tol or lower contact_tol"
            )
        for name in ("contact", "linear"):
            if not callable(getattr(self, name)):
                example = {"contact": "point_to_curve", "linear": "banded"}[name]
                raise ValueError(f"Scheme: {name} = {getattr(self, name)!r}; use a function, as {name}.{example}")
        if not self.inertia and self.theta != 1.0:
            raise ValueError(f"Scheme: theta = {self.theta} without inertia; quasi-static steps need theta = 1")
        if acts_at_grid_nodes(self.contact) and self.anchor != 0.0:
            raise ValueError(
                f"Scheme: contact = shared_grid with anchor = {self.anchor}; bodies share nodes only where"
                " body grids are rebuilt at every step: use anchor = 0"
            )

    def __repr__(self) -> str:
        chosen = {f.name: getattr(self, f.name) for f in fields(self) if getattr(self, f.name) != f.default}
        shown = (f"{name}={getattr(value, '__name__', repr(value))}" for name, value in chosen.items())
        return f"Scheme({', '.join(shown)})"

    @property
    def keeps_nodal_velocities(self) -> bool:
        """Whether nodes go on from their own velocities: with inertia, on body grids that are built once.

        What points keep is smoother: new body grids could make more of what is left out, the more as nothing damps
        it, and as an initial guess of quasi-static steps it is the better one.
        """
        return self.inertia and self.anchor == float("inf")

    @staticmethod
    def fast(**choices: Any) -> Scheme:
        """Loose tolerance for a coarse grid: a quick look at a scene.

        Meant for R/h = 3.2, points 0.74 h apart and four times the time step of `balanced`. The study
        `work_precision` has its errors and its cost, as those of the other two presets.

        Parameters
        ----------
        choices : fields that differ, as in ``Scheme.fast(inertia=False)``

        Returns
        -------
        the scheme
        """
        return replace(Scheme(newton_tol=1e-2), **choices)

    @staticmethod
    def balanced(**choices: Any) -> Scheme:
        """The defaults: no other setting of the study is 1.3 times cheaper at its error on more than one scene.

        Meant for R/h = 5, points 0.74 h apart, steps in which a lid moves by 0.02 R or waves travel 0.1 R.

        Parameters
        ----------
        choices : fields that differ

        Returns
        -------
        the scheme
        """
        return Scheme(**choices)

    @staticmethod
    def accurate(**choices: Any) -> Scheme:
        """Tight tolerance for a fine grid: the error of the iteration is negligible.

        Meant for R/h = 10, points 0.5 h apart and a quarter of the time step of `balanced`.

        Parameters
        ----------
        choices : fields that differ

        Returns
        -------
        the scheme
        """
        return replace(Scheme(newton_tol=1e-6), **choices)

    @staticmethod
    def nezamabadi2017() -> Scheme:
        """The method of Nezamabadi et al. (2017): regridding at every step, shared-grid contact."""
        return Scheme(anchor=0.0, contact=shared_grid, moment_fitting=False, mean_dilatation=False)


def averages_dilatation(scheme: Scheme, material: Material) -> bool:
    """Whether the dilatation of a material is averaged over cells: by the scheme, by memory or by Poisson's ratio."""
    if scheme.mean_dilatation is not None:
        return scheme.mean_dilatation
    return has_memory(material) or poisson_ratio(material) > NEARLY_INCOMPRESSIBLE - ROUND_OFF
