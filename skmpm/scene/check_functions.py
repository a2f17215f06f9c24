"""Check that the functions of a scene take what they are called with."""

from __future__ import annotations

from collections.abc import Iterator
from inspect import signature

from skmpm.scene.input import Input
from skmpm.scene.objects import TURNING, Body, Load, Pressure, SceneError, Spring, Support, Wall
from skmpm.scene.periodic import Periodic

Given = Iterator[tuple[str, object, str]]

TIME, POSITIONS, FIELD = "t", "x", "X, t"
REMEDY = {
    TIME: "give a function of the time t [s]",
    POSITIONS: "give a function of positions x (2, n) [m]",
    FIELD: "give a function of positions X (2, n) [m] and the time t [s]",
}


def check_functions(scene: Input) -> None:
    """Raise SceneError for the first function that cannot be called with its arguments; none is called."""
    for name, function, arguments in _given(scene):
        if not callable(function):
            continue
        try:
            accepted = signature(function)
        except ValueError:  # callables that are not written in Python have no signature
            continue
        try:
            accepted.bind(*arguments.split(", "))
        except TypeError:
            remedy = REMEDY[arguments]
            if name.startswith("support") and arguments == TIME:
                remedy = f"{remedy}; {TURNING}"
            message = f"{name} takes the arguments {accepted} and is called with ({arguments}); {remedy}"
            raise SceneError(message) from None


def _given(scene: Input) -> Given:
    """Name, function or value, and arguments."""
    yield "gravity", scene.gravity, FIELD
    for kind, objects in (
        ("body", scene.bodies),
        ("wall", scene.walls),
        ("support", scene.supports),
        ("load", scene.loads),
        ("spring", scene.springs),
    ):
        for i, each in enumerate(objects):
            for what, argument in FUNCTIONS.get(type(each), {}).items():
                yield f"{kind} {i}: {what}", getattr(each, what), argument
    if isinstance(scene.periodic, Periodic):
        yield "periodic: rate", scene.periodic.rate, TIME
        yield "periodic: stress", scene.periodic.stress, TIME


FUNCTIONS: dict[type, dict[str, str]] = {
    Body: {"velocity": POSITIONS, "motion": TIME},
    Wall: {"velocity": TIME, "force": TIME, "pressure": TIME},
    Support: {"where": POSITIONS, "velocity": TIME, "displacement": TIME},
    Load: {"where": POSITIONS, "force": TIME},
    Pressure: {"where": POSITIONS, "value": TIME},
    Spring: {"where": POSITIONS, "to": POSITIONS, "rest": TIME},
}
