"""Whether the functions of a material fit each other: what one runs on a material of one's own before a scene."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

from skmpm.arrays import Array
from skmpm.material.law import (
    FUNCTIONS,
    Material,
    is_linear,
    isotropic_tensor,
    poisson_ratio,
    product,
    youngs_modulus,
)
from skmpm.material.memory import InStep, MaterialWithMemory, has_memory, in_step, virgin
from skmpm.material.requirements import lacking

SAME = 1e-8  # of the largest internal variable, for what should not change; a return mapping may iterate
SLIGHT, GREAT = 1e-4, 1e-1  # deformations since the state was reached, on which laws still unload or flow again
STATES = 200
COMPLEX = 1e-30  # step; no difference is formed, so that any is good that does not underflow
REAL = 1e-6  # step of central differences: their error is its square, their rounding 1e-16 over it
EXACT, DIFFERENCES = 1e-9, 1e-5  # of the largest entry: derivatives by complex steps and by differences
LARGEST = 0.35  # logarithm of the stretches
SMALLEST = 0.01  # range of logarithmic stretches within which every law must be defined


def histories(material: Any, F: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Internal variables (k, n) of points that were deformed by F (2, 2, n), and deformations from there on."""
    state, n = virgin(material).update(F), F.shape[-1]  # type: ignore[attr-defined]
    size = np.exp(rng.uniform(np.log(SLIGHT), np.log(GREAT), n))
    return state, product(np.eye(2)[:, :, None] + size * rng.uniform(-1.0, 1.0, (2, 2, n)), F)


def check_update(name: str, material: Any, F: Array, state: Array, turn: Array) -> str:
    """Check that `update` is finite, keeps what it gave, turns with the body, and that no energy is won.

    Parameters
    ----------
    F : (2, 2, n) at the end of the step
    state : (k, n) at its start
    turn : (2, 2, n) rotations
    """
    after = np.asarray(material.update(F, state))
    if after.shape != state.shape or not np.isfinite(after).all():
        raise ValueError(f"{name}: update(F, state) is not finite numbers of shape {state.shape}")
    size, offs = max(float(np.abs(after).max()), 1e-300), []
    for what, again in (
        ("update(F, update(F, state))", np.asarray(material.update(F, after))),
        ("update(Q F, state)", np.asarray(material.update(product(turn, F), state))),
    ):
        offs.append(float(np.abs(again - after).max()) / size)
        if not offs[-1] <= SAME:
            raise ValueError(
                f"{name}: {what} and update(F, state) differ by {offs[-1]:.2e} of the largest (at most {SAME:g})"
            )
    scale = float(np.abs(material.energy(F, state)).max())
    before, then = (InStep(material, s).stress(F) for s in (state, after))
    off = float(np.abs(then - before).max() / np.abs(before).max())
    if not off <= SAME:
        raise ValueError(
            f"{name}: stress(F, update(F, state)) and stress(F, state) differ by {off:.2e} of the largest entry (at"
            f" most {SAME:g}); energy(F, state) is the minimum over the internal variables at the end of the step"
        )
    lost = InStep(material, state).dissipated(F, after)
    if not lost.min() >= -SAME * scale:
        raise ValueError(
            f"{name}: energy(F, state) - energy(F, update(F, state)) is {lost.min():.4g} Pa; a step dissipates energy"
        )
    changed = float((np.abs(after - state).max(axis=0) > SAME * size).mean())
    return (
        f"update keeps what it gave and turns with the body: to {max(offs):.1e}; {changed:.0%} of the states change"
    )


def check_material(material: Material | MaterialWithMemory) -> str:
    """Check whether a material's functions fit each other, at random deformations.

    Parameters
    ----------
    material : the material

    Returns
    -------
    a short report

    Raises
    ------
    ValueError
        naming what is off, by how much and at which F

    Notes
    -----
    The stress is compared with the derivative of the energy and the tangent with that of the stress (by complex steps
    where the functions take complex F, else by central differences), the tangent with its transpose, energy and
    stress with those of the turned body (but for small-strain laws, `linear`, which are not objective; their tangent
    must be constant), stress and energy with zero at F = I, `lame` with the tangent there, which must be isotropic.
    The energy of others must be inf where J <= 0. A `stress_zz` must not change as the body turns, and begins as
    lambda tr(F - I). Where the energy of a law is inf at the deformations of the check, these are made smaller.
    Materials with memory are checked for steps from states that `update` gave. It must keep them, and with them the
    stress; a step must not gain energy.

    Examples
    --------
    >>> import skmpm
    >>> report = skmpm.check_material(skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> report.splitlines()[0]
    'NeoHookean: E = 1e+06 Pa, nu = 0.3 at small strain'
    """
    name, remembering = type(material).__name__, has_memory(material)
    if problem := lacking(material):
        raise ValueError(f"{name}: {problem}")
    given, material = material, virgin(material)
    F, linear = _states(name, material), is_linear(material)
    lines = [f"{name}: E = {youngs_modulus(material):.4g} Pa, nu = {poisson_ratio(material):.4g} at small strain"]
    if not linear and (largest := float(np.linalg.norm(F, 2, axis=(0, 1)).max())) < np.exp(0.5 * LARGEST):
        lines.append(f"checked for stretches up to {largest:.4g}; the energy is infinite at larger ones")
    subject, deformed = material, F
    if remembering:
        state, deformed = histories(given, F, np.random.default_rng(3))
        subject = in_step(given, state)
    for of, what in pairwise(FUNCTIONS):
        found = getattr(subject, what)(deformed)
        slope, how, tolerance = _derivative(getattr(subject, of), deformed, found)
        off = _compared(name, f"{what} and the derivative of the {of}", found, slope, deformed, tolerance)
        lines.append(f"{what} is the derivative of the {of}: to {off:.1e} ({how})")
    C = subject.tangent(deformed)
    off = _compared(name, "tangent and its transpose", C, C.transpose(2, 3, 0, 1, 4), deformed, EXACT)
    lines.append(f"tangent is symmetric: to {off:.1e}")
    lines.append(_constant(name, material, F) if linear else _turned(name, subject, deformed))
    if remembering:
        lines.append(check_update(name, given, deformed, state, _rotations(np.random.default_rng(2))))
    if not linear:
        lines.append(_inverted(name, material, F))
    lines.append(_at_rest(name, material))
    if hasattr(given, "stress_zz"):
        lines.append(_across(name, material, F))
    return "\n  ".join(lines)


def _at_rest(name: str, material: Material) -> str:
    """Stress and energy at F = I, which should be zero, and the tangent, which should be isotropic with `lame`."""
    (lam, mu), rest = material.lame, np.eye(2)[:, :, None]
    at_rest = max(np.abs(material.stress(rest)).max(), np.abs(material.energy(rest)).max()) / (lam + 2.0 * mu)
    if not at_rest <= EXACT:
        raise ValueError(f"{name}: stress or energy at F = I is {at_rest:.2e} of lambda + 2 mu; it should be zero")
    C = np.asarray(material.tangent(rest))
    own = float(C[0, 0, 1, 1, 0]), float(C[0, 1, 0, 1, 0])
    found = f"that of lambda = {own[0]:.6g}, mu = {own[1]:.6g} Pa; give these"
    if not np.abs(C - isotropic_tensor(*own)).max() <= 1e-6 * np.abs(C).max():
        entries = f"{C[0, 0, 0, 0, 0]:.6g}, {C[1, 1, 1, 1, 0]:.6g}, {own[0]:.6g}, {own[1]:.6g} Pa"
        found = f"not isotropic (C_xxxx, C_yyyy, C_xxyy, C_xyxy = {entries}); use a law that is isotropic at F = I"
    remedy = f"lame = ({lam:.6g}, {mu:.6g}) Pa, and the tangent there is {found}"
    off = _compared(name, "lame and the tangent at F = I", isotropic_tensor(lam, mu), C, rest, 1e-6, remedy)
    return f"no stress and no energy at rest; lame is the tangent there: to {off:.1e}"


def _states(name: str, material: Material) -> Array:
    """Rotation, stretches from 0.7 to 1.4 and rotation, (2, 2, n); at most 5 % without rotation if linear.

    The logarithms of stretches are halved until the energy is finite everywhere.
    """
    rng = np.random.default_rng(0)
    if is_linear(material):
        return np.asarray(np.eye(2)[:, :, None] + rng.uniform(-0.05, 0.05, (2, 2, STATES)))
    stretch, largest = np.zeros((2, 2, STATES)), LARGEST
    logarithms, first, second = rng.uniform(-1.0, 1.0, (2, STATES)), _rotations(rng), _rotations(rng)
    while True:
        stretch[0, 0], stretch[1, 1] = np.exp(largest * logarithms)
        F = product(product(first, stretch), second)
        with np.errstate(all="ignore"):
            energy = np.asarray(material.energy(F), dtype=float)
        if np.isfinite(energy).all():
            return _finite(name, material, F)
        bad = int(np.argmin(np.isfinite(energy)))
        if not (energy[~np.isfinite(energy)] == np.inf).all():
            bad = int(np.argmax(np.isnan(energy) | (energy == -np.inf)))
            raise ValueError(f"{name}: energy is {energy[bad]} {_at(F, bad)}; give inf outside of the law's domain")
        largest *= 0.5
        if largest < SMALLEST:
            raise ValueError(f"{name}: energy is inf {_at(F, bad)}, at strains of 2 %; a law must be defined there")


def _finite(name: str, material: Material, F: Array) -> Array:
    """F, if stress and tangent are finite there, as the energy is."""
    for what in ("stress", "tangent"):
        finite = np.isfinite(getattr(material, what)(F)).reshape(-1, F.shape[-1]).all(axis=0)
        if not finite.all():
            raise ValueError(f"{name}: {what} is not finite {_at(F, int(np.argmin(finite)))}, but the energy is")
    return F


def _at(F: Array, worst: int) -> str:
    return "at F = " + np.array2string(F[..., worst], precision=4).replace("\n", "")


def _constant(name: str, material: Material, F: Array) -> str:
    """Whether the stress of a `linear` law is linear: its tangent is that at F = I."""
    rest = np.broadcast_to(material.tangent(np.eye(2)[:, :, None]), (2, 2, 2, 2, F.shape[-1]))
    what, remedy = "tangent and that at F = I of a law that says linear = True", "the stress is not linear in F"
    _compared(name, what, material.tangent(F), rest, F, EXACT, f"{remedy}; leave `linear` out")
    return "objectivity: exempt, a law of small strain, linear as it says"


def _inverted(name: str, material: Material, F: Array) -> str:
    """Whether the energy is inf where J <= 0: mirrored deformations, and flat ones."""
    flat = np.array([[[1.0], [0.0]], [[0.0], [0.0]]])
    mirrored = np.concatenate([F * np.array([1.0, -1.0])[None, :, None], flat], axis=2)
    with np.errstate(all="ignore"):
        energy = np.asarray(material.energy(mirrored), dtype=float)
    if not (energy == np.inf).all():
        bad = int(np.argmin(energy == np.inf))
        raise ValueError(
            f"{name}: energy is {energy[bad]:.4g} {_at(mirrored, bad)}, where J <= 0; give inf there, so that line"
            " searches turn back"
        )
    return "energy is inf where J <= 0"


def _across(name: str, material: Material, F: Array) -> str:
    """Whether `stress_zz` has a value per point, is objective, and lambda tr(F - I) at small strain."""
    stress_zz: Callable[[Array], Array] = material.stress_zz  # type: ignore[attr-defined]
    lam, mu = material.lame
    rest, turn, step = np.eye(2)[:, :, None], _rotations(np.random.default_rng(1)), 1e-6
    found = np.asarray(stress_zz(F))
    if found.shape != F.shape[2:] or not np.isfinite(found).all():
        raise ValueError(f"{name}: stress_zz(F) is not one finite number per point, {F.shape[2:]}, of F {F.shape}")
    if not is_linear(material):
        _compared(name, "stress_zz(Q F) and stress_zz(F)", stress_zz(product(turn, F)), found, F, EXACT)
    at_rest = float(np.abs(stress_zz(rest)).max()) / (lam + 2.0 * mu)
    if not at_rest <= EXACT:
        raise ValueError(f"{name}: stress_zz at F = I is {at_rest:.2e} of lambda + 2 mu; it should be zero")
    slopes = np.array([stress_zz(rest + d) - stress_zz(rest - d) for d in _directions(step)]) / (2.0 * step)
    off = float(np.abs(slopes[:, 0] - lam * np.array([1.0, 0.0, 0.0, 1.0])).max()) / (lam + 2.0 * mu)
    if not off <= DIFFERENCES:
        raise ValueError(
            f"{name}: stress_zz at small strain is not lambda tr(F - I), lambda = {lam:.6g} Pa of `lame`, but"
            f" {slopes[0, 0]:.6g} (F_xx - 1) + {slopes[3, 0]:.6g} (F_yy - 1); give the out-of-plane Cauchy stress"
        )
    return f"stress_zz turns with the body and is lambda tr(F - I) at small strain: to {off:.1e}"


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


def _compared(
    name: str, what: str, found: Array, expected: Array, F: Array, tolerance: float, remedy: str = ""
) -> float:
    """Largest difference over the largest entry; ValueError where that is beyond the tolerance."""
    size = float(np.abs(expected).max())
    off = np.abs(found - expected).reshape(-1, F.shape[-1]).max(axis=0) / max(size, 1e-300)
    worst = int(np.argmax(np.nan_to_num(off, nan=np.inf)))
    if not off[worst] <= tolerance:
        by = f"differ by {off[worst]:.2e} of the largest entry (at most {tolerance:g})"
        raise ValueError(f"{name}: {what} {by}, {_at(F, worst)}" + (f"; {remedy}" if remedy else ""))
    return float(off[worst])
