"""Values that users give, checked: numbers, vectors, fields, and functions of time.

Raises of all these functions: SceneError, which names the object, the value and the remedy.
"""

from __future__ import annotations

import copyreg
from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from skmpm.arrays import Array

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

LENGTH = "a length in metres"  # what `positive` asks for


class SceneError(ValueError):
    """An error in a scene: names the object, the value and the remedy.

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> try:
    ...     skmpm.Scene([body], cell=-1.0)
    ... except skmpm.SceneError as error:
    ...     print(error)
    cell = -1.0; give a cell size in metres, about a fifth of the smallest radius, greater than zero
    """


def text_and_attributes(error: BaseException) -> tuple[object, ...]:
    """What pickles an error whose constructor makes its text from parts: its text and its attributes."""
    return copyreg.__newobj__, (type(error), *error.args), error.__dict__  # type: ignore[attr-defined]


class Given:
    """A dataclass of what a user gives, as it is when it is made: arrays and lists become tuples, dicts are copied.

    So nothing changes with an array that is written to later, and objects with arrays are equal or not as others.
    """

    def __post_init__(self: DataclassInstance) -> None:
        for each in fields(self):
            object.__setattr__(self, each.name, _kept(getattr(self, each.name)))


def _kept(value: object) -> object:
    if hasattr(value, "__array__"):
        value = np.asarray(value).tolist()
    if isinstance(value, Mapping):
        return {key: _kept(item) for key, item in value.items()}
    return tuple(map(_kept, value)) if isinstance(value, list | tuple) else value


def motion(velocity: ArrayLike | Callable[..., ArrayLike], t: float, name: str = "velocity") -> Array:
    """A prescribed velocity (2,) [m/s] at time t, from a constant or a function of time.

    Raises
    ------
    SceneError
        if it is not two finite numbers; `name` is that of the velocity in the message
    """
    if callable(velocity):
        return vector(f"{name} at t = {t:.6g} s", velocity(t))
    return vector(name, velocity)


def scalar(value: object, t: float, name: str) -> float:
    """A number, or the value at time t of a function of time; SceneError if it is not finite."""
    if callable(value):
        return number(f"{name} at t = {t:.6g} s", value(t), "give a finite number")
    return number(name, value, "give a finite number")


def vector(name: str, value: ArrayLike) -> Array:
    """The value as an array (2,); SceneError if it is not two finite numbers."""
    remedy = "give two finite numbers (x, y)"
    array = numbers(name, value, remedy)
    if array.shape != (2,) or not np.isfinite(array).all():
        raise SceneError(f"{name} = {value!r}; {remedy}")
    return array


def field_values(name: str, value: ArrayLike, x: Array) -> Array:
    """The values (2, n) of a field at positions x (2, n); SceneError if shape or values are wrong."""
    remedy = f"return finite numbers of the shape {x.shape} of the positions"
    array = numbers(name, value, remedy)
    if array.shape != x.shape:
        raise SceneError(f"{name} has the shape {array.shape}; {remedy}")
    if not np.isfinite(array).all():
        point = int(np.argmin(np.isfinite(array).all(axis=0)))
        raise SceneError(f"{name} is {array[:, point]} at x = {x[:, point]}; {remedy}")
    return array


def number(name: str, value: object, remedy: str, low: float = -np.inf, high: float = np.inf) -> float:
    """The value as a float; SceneError if it is not one finite number from `low` to `high`."""
    result = numbers(name, value, remedy)  # type: ignore[arg-type]
    if result.ndim or not (np.isfinite(result) and low <= result <= high):
        raise SceneError(f"{name} = {value}; {remedy}")
    return float(result)


def positive(name: str, value: object, what: str) -> float:
    """The value as a float; SceneError if it is not greater than zero."""
    return number(name, value, f"give {what}, greater than zero", low=np.nextafter(0.0, 1.0))


def not_negative(name: str, value: object, what: str) -> float:
    """The value as a float; SceneError if it is less than zero."""
    return number(name, value, f"give {what} of zero or more", low=0.0)


def numbers(name: str, value: ArrayLike, remedy: str) -> Array:
    """A copy of the value as an array of floats; SceneError if it cannot be converted, or is text.

    A user's function may return the same array again, with other values.
    """
    try:
        if np.asarray(value).dtype.kind in "US":
            raise TypeError("text")
        return np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise SceneError(f"{name} = {value!r} is not a number or an array of numbers; {remedy}") from None


def components(name: str, value: object, count: int, remedy: str) -> Array:
    """Components (count,), nan where they are None; SceneError if they are no finite numbers or None."""
    given = np.array(value, dtype=object)
    if given.shape != (count,):
        raise SceneError(f"{name} = {value!r}; {remedy}")
    free = np.array([v is None for v in given])
    filled = numbers(name, np.where(free, 0.0, given).tolist(), remedy)
    if not np.isfinite(filled).all():
        raise SceneError(f"{name} = {value!r}; {remedy}")
    return np.where(free, np.nan, filled)
