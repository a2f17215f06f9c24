"""Materials with memory: laws of F and of internal variables, which a step changes once, at its end.

In a step such a material has a potential W(F; state) whose minimisation over the change of its internal variables is
done (Ortiz & Stainier, CMAME 171, 1999): with the state at the start of the step it is a function of F alone, and all
that is built on functions of F (anchors, mean dilatation, Newton's method) holds for it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from skmpm.arrays import Array
from skmpm.material.law import Material, determinant, product, viscosity_of


class MaterialWithMemory(Protocol):
    """A material with internal variables, k numbers at every point: plasticity, damage.

    What `Material` says of hashing, `density`, `lame`, `viscosity` and of F holds. `state` (k, n) are the internal
    variables at the start of the step, F (2, 2, n) is the total deformation gradient at its end; with mean dilatation
    it has the dilatation of the cell. The dissipation of a step that ends with F and `new = update(F, state)` is
    ``energy(F, state) - energy(F, new)``, and ``update(F, new)`` is `new` again. Optional:

    - `plastic_strain(state)`: equivalent plastic strain (n,), for pictures and recordings
    - `stress_zz(stress, state)`: out-of-plane Cauchy stress (n,) [Pa] of that in the plane (2, 2, n) and the state

    Examples
    --------
    >>> import numpy as np
    >>> import skmpm
    >>> law: skmpm.MaterialWithMemory = skmpm.ElastoPlastic(E=2e11, nu=0.3, density=7800, yield_stress=2e8)
    >>> F, state = np.diag([1.01, 1.0])[:, :, None], np.array(law.state0)[:, None]
    >>> new = law.update(F, state)
    >>> new.shape
    (4, 1)
    >>> bool(law.energy(F, new) < law.energy(F, state))
    True
    """

    @property
    def density(self) -> float:
        """Initial density [kg/m3]."""

    @property
    def lame(self) -> tuple[float, float]:
        """Lame constants (lambda, mu) of the tangent at F = I with `state0` [Pa]."""

    @property
    def state0(self) -> tuple[float, ...]:
        """Internal variables of the virgin material, k finite numbers."""

    def energy(self, F: Array, state: Array) -> Array:
        """Stored energy plus dissipation of the step, (n,) [Pa]; inf where F is outside the domain, as J <= 0."""

    def stress(self, F: Array, state: Array) -> Array:
        """First Piola-Kirchhoff stress, the derivative of `energy` by F, (2, 2, n) [Pa]."""

    def tangent(self, F: Array, state: Array) -> Array:
        """Derivative of `stress` by F, symmetric, (2, 2, 2, 2, n) [Pa]."""

    def update(self, F: Array, state: Array) -> Array:
        """Internal variables at the end of the step, (k, n)."""


def has_memory(material: object) -> bool:
    """Whether a material has internal variables."""
    return hasattr(material, "state0")


def initial_state(material: Any, n: int = 1) -> Array:
    """Internal variables of n virgin points, (k, n); (0, n) of a material without memory."""
    state0 = np.asarray(material.state0 if has_memory(material) else (), dtype=float)
    return np.repeat(state0[:, None], n, axis=1)


@dataclass(frozen=True, eq=False)
class InStep:
    """A material with memory in a step that begins with `state`: a `Material`, a function of F alone."""

    material: Any
    state: Array  # (k, n), or (k, 1) for any number of points

    @property
    def density(self) -> float:
        """Initial density [kg/m3]."""
        return float(self.material.density)

    @property
    def lame(self) -> tuple[float, float]:
        """Lame constants (lambda, mu) of the tangent at F = I with `state0` [Pa]."""
        lam, mu = self.material.lame
        return lam, mu

    @property
    def viscosity(self) -> float:
        """Viscosity of Kelvin and Voigt's model [Pa s]."""
        return viscosity_of(self.material)

    def energy(self, F: Array) -> Array:
        """Potential of the step, (n,) [Pa]."""
        return np.asarray(self.material.energy(F, self._at(F)))

    def stress(self, F: Array) -> Array:
        """First Piola-Kirchhoff stress, (2, 2, n) [Pa]."""
        return np.asarray(self.material.stress(F, self._at(F)))

    def tangent(self, F: Array) -> Array:
        """Derivative of `stress` by F, (2, 2, 2, 2, n) [Pa]."""
        return np.asarray(self.material.tangent(F, self._at(F)))

    def update(self, F: Array) -> Array:
        """Internal variables after the step, (k, n)."""
        return np.asarray(self.material.update(F, self._at(F)))

    def stress_zz(self, F: Array) -> Array:
        """Out-of-plane Cauchy stress after the step, (n,) [Pa]; AttributeError if the material does not say."""
        cauchy = product(self.stress(F), F.swapaxes(0, 1)) / determinant(F)
        return np.asarray(self.material.stress_zz(cauchy, self.update(F)))

    def dissipated(self, F: Array, after: Array) -> Array:
        """Dissipation of the step per undeformed volume, (n,) [Pa], `after` (k, n) its `update`."""
        return np.asarray(self.energy(F) - self.material.energy(F, after))

    def _at(self, F: Array) -> Array:
        return np.broadcast_to(self.state, (self.state.shape[0], F.shape[-1]))


def in_step(material: Any, internal: Array | None) -> Material:
    """The material as a function of F alone in a step; itself if it has no memory.

    `internal` (k or more, n) are the internal variables of its points at the start of the step, as in `State`.
    """
    if internal is None or not has_memory(material):
        return material  # type: ignore[no-any-return]
    return InStep(material, internal[: len(material.state0)])


def virgin(material: Any) -> Material:
    """The material as a function of F alone, without history."""
    return in_step(material, initial_state(material))
