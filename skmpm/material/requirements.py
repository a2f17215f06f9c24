"""What an object must have to be a material, at rest: what every scene asks of its materials."""

from __future__ import annotations

from numbers import Real
from typing import Any

import numpy as np

from skmpm.arrays import Array
from skmpm.material.law import FUNCTIONS, NEEDED, Material
from skmpm.material.memory import has_memory, initial_state, virgin

TOLERANCE = 1e-12  # of internal variables that are to stay as they are, over the largest
SHAPES: dict[str, tuple[int, ...]] = {"energy": (), "stress": (2, 2), "tangent": (2, 2, 2, 2)}


def lacking(material: object) -> str:
    """What keeps an object from being a material, in words; "" if nothing does."""
    missing = [name for name in NEEDED if not _has(material, name)]
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


def _has(material: object, name: str) -> bool:
    """Whether an object has an attribute; one whose value divides by zero, too."""
    try:
        return hasattr(material, name)
    except ArithmeticError:
        return True


def _misshapen(material: Material) -> str:
    """What is wrong with the numbers of a material at rest."""
    density, viscosity = material.density, getattr(material, "viscosity", 0.0)
    if not (_is_number(density) and density > 0.0):
        return f"density = {density!r}; give a finite number in kg/m3, greater than zero"
    if not (_is_number(viscosity) and viscosity >= 0.0):
        return f"viscosity = {viscosity!r}; give one in Pa s, zero or more"
    try:
        lame = material.lame
    except ArithmeticError as error:
        return (
            f"lame raises {type(error).__name__}: {error}; give E > 0 and 0 <= nu < 0.5: for rubber 0.499, which mean"
            " dilatation, the default, keeps from locking"
        )
    lam, mu = lame if np.shape(lame) == (2,) and all(map(_is_number, lame)) else (np.nan, np.nan)
    if not (mu > 0.0 and 3.0 * lam + 2.0 * mu > 0.0):
        return f"lame = {lame!r}; give (lambda, mu) in Pa with mu > 0 and 3 lambda + 2 mu > 0"
    rest = np.repeat(np.eye(2)[:, :, None], 3, axis=2)
    if has_memory(material) and (problem := _wrong_memory(material, rest)):
        return problem
    return _wrong_values(material, rest)


def _wrong_memory(material: Any, F: Array) -> str:
    """What is wrong with the internal variables of a material, and with their update at F = I, (2, 2, 3)."""
    state0 = material.state0
    if not (np.ndim(state0) == 1 and np.size(state0) and all(map(_is_number, state0))):
        return f"state0 = {state0!r}; give its internal variables, a tuple of finite numbers"
    if not callable(getattr(material, "update", None)):
        return "it lacks update(F, state)"
    if getattr(material, "linear", False):
        return "linear = True with memory; leave `linear` out"
    state = initial_state(material, 3)
    functions: list[tuple[str, tuple[Array, ...], tuple[int, ...]]] = [("update", (F, state), state.shape)]
    functions += [("plastic_strain", (state,), (3,))] if hasattr(material, "plastic_strain") else []
    for name, arguments, shape in functions:
        try:
            value = np.asarray(getattr(material, name)(*arguments))
        except Exception as error:  # whatever a function of the user raises
            return f"{name} raises {type(error).__name__}: {error}, at F = I and state0, 3 points"
        if value.shape != shape or not np.isfinite(value).all():
            return f"{name} gives {value.tolist()} at F = I and state0, 3 points; give finite numbers, {shape}"
        if name == "update" and np.abs(value - state).max() > TOLERANCE * max(1.0, np.abs(state).max()):
            return f"update gives {value[:, 0].tolist()} at F = I and state0 = {state0!r}; give state0 there"
    return ""


def _is_number(value: object) -> bool:
    return isinstance(value, Real) and bool(np.isfinite(float(value)))


def _wrong_values(material: Material, F: Array) -> str:
    """What is wrong with the shapes and values of a material's functions at F = I, (2, 2, 3)."""
    at_rest = virgin(material)
    for name, shape in {**SHAPES, **({"stress_zz": ()} if hasattr(material, "stress_zz") else {})}.items():
        try:
            value = np.asarray(getattr(at_rest, name)(F))
        except Exception as error:  # whatever a function of the user raises
            return f"{name}(F) raises {type(error).__name__}: {error}, at F = I of shape {F.shape}"
        if value.shape != (*shape, 3):
            return f"{name}(F) has shape {value.shape} at 3 points; give {(*shape, 3)}"
        if not np.isfinite(value).all():
            return f"{name}(F) is not finite at F = I"
    return ""
