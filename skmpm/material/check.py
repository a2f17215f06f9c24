"""Whether the functions of a material fit each other: what one runs on a material of one's own before a scene."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skmpm.material.law import FUNCTIONS, NEEDED, Material, is_linear, poisson_ratio, product, youngs_modulus

Array = NDArray[np.float64]

SHAPES: dict[str, tuple[int, ...]] = {"energy": (), "stress": (2, 2), "tangent": (2, 2, 2, 2)}
STATES = 200
COMPLEX = 1e-30  # step; no difference is formed, so that any is good that does not underflow
REAL = 1e-6  # step of central differences: their error is its square, their rounding 1e-16 over it
EXACT, DIFFERENCES = 1e-9, 1e-5  # of the largest entry: derivatives by complex steps and by differences


def lacking(material: object) -> str:
    """What keeps an object from being a material, in words; "" if nothing does."""
    missing = [name for name in NEEDED if not hasattr(material, name)]
    missing += [f"{name}(F)" for name in FUNCTIONS if name not in missing and not callable(getattr(material, name))]
    if isinstance(material, type):
        return "it is a class; make one of it by its constants"
    if missing:
        return f"it lacks {', '.join(missing)}"
    try:
        hash(material)
    except TypeError:
        return "it is not hashable; make it a frozen dataclass of numbers and tuples"
    return _misshapen(material)  # type: ignore[arg-type]


def _misshapen(material: Material) -> str:
    """What is wrong with the numbers of a material at rest."""
    lam, mu = np.asarray(material.lame, dtype=float).ravel() if np.size(material.lame) == 2 else (np.nan, np.nan)
    if not (np.isfinite([lam, mu]).all() and mu > 0.0 and 3.0 * lam + 2.0 * mu > 0.0):
        return f"lame = {material.lame!r}; give (lambda, mu) in Pa with mu > 0 and 3 lambda + 2 mu > 0"
    viscosity = getattr(material, "viscosity", 0.0)
    if not (np.ndim(viscosity) == 0 and np.isreal(viscosity) and 0.0 <= viscosity < np.inf):
        return f"viscosity = {viscosity!r}; give one in Pa s, zero or more"
    F = np.repeat(np.eye(2)[:, :, None], 3, axis=2)
    for name, shape in SHAPES.items():
        value = np.asarray(getattr(material, name)(F))
        if value.shape != (*shape, 3):
            return f"{name}(F) has shape {value.shape} at 3 points; give {(*shape, 3)}"
        if not np.isfinite(value).all():
            return f"{name}(F) is not finite at F = I"
    return ""


def check_material(material: Material) -> str:
    """A short report on whether a material's functions fit each other, at random deformations.

    The stress is compared with the derivative of the energy and the tangent with that of the stress (by complex steps
    where the functions take complex F, else by central differences), the tangent with its transpose, energy and
    stress with those of the turned body (small-strain laws, `linear`, are exempt and do turn wrong), stress and
    energy with zero at F = I, `lame` with the tangent there.

    Raises
    ------
    ValueError
        naming what is off, by how much and at which F
    """
    name = type(material).__name__
    if problem := lacking(material):
        raise ValueError(f"{name}: {problem}")
    F, linear = _states(material), is_linear(material)
    lam, mu = material.lame
    scale = lam + 2.0 * mu
    lines = [f"{name}: E = {youngs_modulus(material):.4g} Pa, nu = {poisson_ratio(material):.4g} at small strain"]
    for what, of, by in (
        ("stress", "energy", material.energy),
        ("tangent", "stress", material.stress),
    ):
        found = getattr(material, what)(F)
        slope, how, tolerance = _derivative(by, F, found)
        off = _compared(name, f"{what} and the derivative of the {of}", found, slope, F, tolerance)
        lines.append(f"{what} is the derivative of the {of}: to {off:.1e} ({how})")
    C = material.tangent(F)
    off = _compared(name, "tangent and its transpose", C, C.transpose(2, 3, 0, 1, 4), F, EXACT)
    lines.append(f"tangent is symmetric: to {off:.1e}")
    lines.append("objectivity: exempt, a law of small strain" if linear else _turned(name, material, F))
    rest = np.eye(2)[:, :, None]
    at_rest = max(np.abs(material.stress(rest)).max(), np.abs(material.energy(rest)).max()) / scale
    if not at_rest <= EXACT:
        raise ValueError(f"{name}: stress or energy at F = I is {at_rest:.2e} of lambda + 2 mu; it should be zero")
    one = np.eye(2)
    hooke = mu * (np.einsum("ik,jl->ijkl", one, one) + np.einsum("il,jk->ijkl", one, one))
    hooke += lam * np.einsum("ij,kl->ijkl", one, one)
    off = _compared(name, "lame and the tangent at F = I", hooke[..., None], material.tangent(rest), rest, 1e-6)
    lines.append(f"no stress and no energy at rest; lame is the tangent there: to {off:.1e}")
    return "\n  ".join(lines)


def _states(material: Material) -> Array:
    """Rotation, stretches from 0.7 to 1.4 and rotation, (2, 2, n); at most 5 % without rotation if linear."""
    rng = np.random.default_rng(0)
    if is_linear(material):
        return np.asarray(np.eye(2)[:, :, None] + rng.uniform(-0.05, 0.05, (2, 2, STATES)))
    stretch = np.zeros((2, 2, STATES))
    stretch[0, 0], stretch[1, 1] = np.exp(rng.uniform(-0.35, 0.35, (2, STATES)))
    return product(product(_rotations(rng), stretch), _rotations(rng))


def _rotations(rng: np.random.Generator) -> Array:
    angle = rng.uniform(0.0, 2.0 * np.pi, STATES)
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def _derivative(function: Callable[[Any], Array], F: Array, expected: Array) -> tuple[Array, str, float]:
    """Derivative of a function of F, how it was found, and how far it can be trusted."""
    try:
        with warnings.catch_warnings(), np.errstate(all="raise", under="ignore"):
            warnings.simplefilter("error")
            slope = np.stack([np.imag(function(F + 1j * d)) / COMPLEX for d in _directions(COMPLEX)])
        slope = np.moveaxis(slope, 0, -2).reshape(expected.shape)
        if np.abs(slope - expected).max() <= EXACT * np.abs(expected).max():
            return slope, "complex step", EXACT
    except (TypeError, ValueError, ArithmeticError, Warning):
        pass  # the function does not take complex numbers
    slope = np.stack([(function(F + d) - function(F - d)) / (2.0 * REAL) for d in _directions(REAL)])
    return np.moveaxis(slope, 0, -2).reshape(expected.shape), "central differences", DIFFERENCES


def _directions(step: float) -> list[Array]:
    return [step * np.eye(4)[k].reshape(2, 2, 1) for k in range(4)]


def _turned(name: str, material: Material, F: Array) -> str:
    turn = _rotations(np.random.default_rng(1))
    W, P = material.energy(product(turn, F)), material.stress(product(turn, F))
    offs = (
        _compared(name, "energy(Q F) and energy(F)", W, material.energy(F), F, EXACT),
        _compared(name, "stress(Q F) and Q stress(F)", P, product(turn, material.stress(F)), F, EXACT),
    )
    return f"energy and stress turn with the body: to {max(offs):.1e}"


def _compared(name: str, what: str, found: Array, expected: Array, F: Array, tolerance: float) -> float:
    """Largest difference over the largest entry; ValueError where that is beyond the tolerance."""
    size = float(np.abs(expected).max())
    off = np.abs(found - expected).reshape(-1, F.shape[-1]).max(axis=0) / max(size, 1e-300)
    worst = int(np.argmax(np.nan_to_num(off, nan=np.inf)))
    if not off[worst] <= tolerance:
        at = np.array2string(F[..., worst], precision=4).replace("\n", "")
        raise ValueError(
            f"{name}: {what} differ by {off[worst]:.2e} of the largest entry (at most {tolerance:g}), at F = {at}"
        )
    return float(off[worst])
