"""Scene (a) of the study: a cantilever against finite elements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from skfem import Basis, CellBasis, ElementQuad2, ElementVector, LinearForm, MeshQuad, condense, solve
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skmpm

from .meter import Meter
from .parameters import Setting, scheme_of
from .statics import LAMBDA, LAWS, MU, NU, E, rotation, turned

Array = NDArray[np.float64]
Measured = dict[str, Any]

LENGTH, DEPTH, FORCE = 4.0, 1.0, -10.0  # [m], [m], [N/m]: the tip sinks by 2e-3 m, and both laws agree to 1e-4
POSITIONS = ((0.3, 0.4, 0.0), (0.62, 0.17, 0.4), (0.11, 0.83, 0.0), (0.87, 0.55, 0.9))  # offset [cells], angle
AWAY = 0.5  # of the clamp and of the loaded end, where stresses are compared [m]


def cantilever(setting: Setting, position: int, meter: Meter) -> Measured:
    """Tip deflection, and the rms of the error of stress away from clamp and load over that of the stress."""
    cell, (*offset, angle) = 0.5 * DEPTH / setting["cells"], POSITIONS[position]
    straight, shift = skmpm.box((0, 0), (LENGTH, DEPTH), spacing=setting["spacing"] * cell), cell * np.array(offset)
    beam = skmpm.Body(turned(straight, angle, shift), LAWS[setting["material"]])

    def along(x: Array) -> Array:
        return np.asarray(rotation(angle)[:, 0] @ (x - shift[:, None]))

    down = FORCE * rotation(angle)[:, 1]
    load = skmpm.Load(lambda x: along(x) > LENGTH - 1e-9, lambda t: down * t)
    scene = skmpm.Scene([beam], cell=cell, supports=[skmpm.Support(lambda x: along(x) < 1e-9)], loads=[load])
    scheme = scheme_of(setting, inertia=False, solver=meter)
    *_, state = meter.states(scene, dt=min(setting["pace"], 1.0), until=1.0, scheme=scheme)
    moved, stress = state.x - scene.initial_positions, state.stress
    back = rotation(angle).T
    tip = np.abs(straight.x - [[LENGTH], [DEPTH / 2]]).max(axis=0) <= DEPTH / 2 + 1e-9
    tip &= straight.x[0] > LENGTH - 1e-9
    found = np.interp(DEPTH / 2, straight.x[1, tip], (back @ moved)[1, tip])
    inside = (straight.x[0] > AWAY) & (straight.x[0] < LENGTH - AWAY)
    _, expected = finite_elements().at(straight.x[:, inside])
    off = np.einsum("ki,ijn,lj->kln", back, stress[:, :, inside], back) - expected
    share = straight.volume[inside]
    return {
        "tip": float(found),
        "errors": {
            "tip": abs(float(found / finite_elements().tip) - 1.0),
            "stress": float(np.sqrt((off**2 @ share).sum() / (expected**2 @ share).sum())),
        },
    }


@dataclass(frozen=True)
class Elements:
    """A solution by finite elements."""

    basis: CellBasis
    u: Array

    @cached_property
    def finder(self) -> Any:
        """Which cells contain points."""
        return self.basis.mesh.element_finder()

    @cached_property
    def tip(self) -> float:
        """Deflection of the middle of the end [m]."""
        return float((self.basis.probes(np.array([[LENGTH], [DEPTH / 2]])) @ self.u)[1])

    def at(self, x: Array) -> tuple[Array, Array]:
        """Displacement (2, n) and stress (2, 2, n) at points (2, n)."""
        mesh, mapping = self.basis.mesh, self.basis.mapping
        cells = self.finder(*x)
        rule = (mapping.invF(x[:, :, None], tind=cells), np.ones((cells.size, 1)))
        options = {"mapping": mapping, "dofs": self.basis.dofs, "disable_doflocs": True}
        u = CellBasis(mesh, self.basis.elem, elements=cells, quadrature=rule, **options).interpolate(self.u)
        gradient = u.grad[..., 0]
        trace = np.einsum("ii...->...", gradient)
        stress = MU * (gradient + gradient.swapaxes(0, 1)) + LAMBDA * trace * np.eye(2)[:, :, None]
        return np.asarray(u)[..., 0], stress


def clamped(size: tuple[float, float], across: int, load: Callable[[CellBasis], Array]) -> Elements:
    """A block that is held at its left end, by quadratic elements, so many per metre; `load` assembles forces."""
    mesh = MeshQuad.init_tensor(*(np.linspace(0.0, side, round(across * side) + 1) for side in size))
    basis = Basis(mesh, ElementVector(ElementQuad2()))
    K = linear_elasticity(*lame_parameters(E, NU)).assemble(basis)
    return Elements(basis, solve(*condense(K, load(basis), D=basis.get_dofs(lambda x: x[0] == 0.0))))


@cache
def finite_elements(across: int = 16) -> Elements:
    """The cantilever; 32 elements across the depth instead of 16 change the tip by 1.6e-4."""
    pull = LinearForm(lambda v, w: FORCE / DEPTH * v[1])
    return clamped((LENGTH, DEPTH), across, lambda basis: pull.assemble(basis.boundary(lambda x: x[0] == LENGTH)))
