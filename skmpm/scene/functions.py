"""What users may give as functions, of positions or of time, and what a step takes of those of time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from skmpm.scene.layout import Layout
from skmpm.scene.objects import Body, Load, Pressure, Spring, Support, Wall
from skmpm.scene.periodic import Periodic

POSITIONS = "positions"
LOAD, VELOCITY, DISPLACEMENT = "load", "velocity", "displacement"  # functions of time
FUNCTIONS: dict[type, dict[str, str]] = {
    Body: {"velocity": POSITIONS, "motion": VELOCITY},
    Wall: {"velocity": VELOCITY, "force": LOAD, "pressure": LOAD},
    Support: {"where": POSITIONS, "velocity": VELOCITY, "displacement": DISPLACEMENT, "rotation": DISPLACEMENT},
    Load: {"where": POSITIONS, "force": LOAD},
    Pressure: {"where": POSITIONS, "value": LOAD},
    Spring: {"where": POSITIONS, "to": POSITIONS, "rest": LOAD},
    Periodic: {"rate": VELOCITY, "stress": LOAD},
}


def may_be_functions(part: object) -> dict[str, str]:
    """The attributes of a part of a scene that may be functions, and the kinds of these."""
    return next(own for of, own in FUNCTIONS.items() if isinstance(part, of))


def functions_of_time(scene: Layout) -> Iterator[tuple[object, str, Callable[[float], Any]]]:
    """The functions of time of a scene, but gravity: the parts that have them, their kinds, and the functions."""
    boxes = () if scene.periodic is None else (scene.periodic,)
    for part in (*scene.bodies, *scene.walls, *scene.supports, *scene.loads, *scene.springs, *boxes):
        for what, kind in may_be_functions(part).items():
            if kind != POSITIONS and callable(f := getattr(part, what)):
                yield part, kind, f


def varies_in_time(scene: Layout) -> bool:
    """Whether a scene has functions of time, gravity included."""
    return callable(scene.gravity) or any(functions_of_time(scene))
