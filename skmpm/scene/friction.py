"""Coefficients of friction of pairs of surfaces: of two bodies, of parts of one, of a body and a wall.

A pair has the coefficient that a table gives for the names of its surfaces, else that which the body or the wall
gives for all its contacts, else the number or the default of the scene.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import NamedTuple

import numpy as np

from skmpm.arrays import Array, Ints
from skmpm.representation import span
from skmpm.scene.layout import Layout
from skmpm.values import SceneError, not_negative

DEFAULT = "default"  # key of a table for pairs without an entry
COEFFICIENT = "a Coulomb coefficient"
EXAMPLE = "{('gel', 'glass'): 0.3, 'default': 0.1}"


@dataclass(frozen=True)
class Friction:
    """Coulomb coefficients of a scene; bodies of one name and own coefficient are one surface, and so are walls."""

    surface: Ints  # (bodies + walls,) of body b at b and of wall i at -1 - i
    coefficient: Array  # (surfaces, surfaces) of pairs, those of bodies first; zero between walls
    of_bodies: int  # number of surfaces of bodies

    def between(self, bodies: Ints) -> Array:
        """Coefficients (k,) of pairs (2, k) of bodies, or of body and wall; walls are -1, -2, ..."""
        first, second = self.surface[bodies]
        return np.asarray(self.coefficient[first, second])

    @property
    def among_bodies(self) -> Array:
        """Coefficients of pairs of bodies' surfaces, and of each with itself."""
        return self.coefficient[: self.of_bodies, : self.of_bodies]

    @property
    def at_walls(self) -> Array:
        """Coefficients of pairs of bodies' and walls' surfaces."""
        return self.coefficient[: self.of_bodies, self.of_bodies :]

    @property
    def largest(self) -> float:
        """The largest coefficient."""
        return float(self.coefficient.max())

    def __str__(self) -> str:
        """The ranges of the coefficients."""
        if not self.coefficient.any():
            return "frictionless"
        several, walls = np.count_nonzero(self.surface < self.of_bodies) > 1, self.at_walls.size > 0
        if not walls:
            return f"friction {span(self.among_bodies, 'g')}"
        if not several or np.unique(self.coefficient[: self.of_bodies]).size == 1:
            return f"friction {span(self.at_walls, 'g')}"
        return f"friction {span(self.among_bodies, 'g')} between bodies, {span(self.at_walls, 'g')} at walls"

    def largest_pair(self) -> str:
        """The first two objects with the largest coefficient, as text."""
        a, b = np.unravel_index(np.argmax(self.coefficient), self.coefficient.shape)
        first, second = (np.flatnonzero(self.surface == surface) for surface in (a, b))
        if b >= self.of_bodies:
            return f"body {first[0]} and wall {self.surface.size - 1 - second[-1]}"
        others = second[second != first[0]]
        return f"bodies {first[0]} and {others[0]}" if others.size else f"body {first[0]} with itself"


def friction_of(scene: Layout) -> Friction:
    """The coefficients of all pairs of a scene.

    Raises
    ------
    SceneError
        if a coefficient is not a number of zero or more, a table has an unknown name or lacks a pair, or two objects
        give different coefficients for their pair
    """
    table, default = _table(scene)
    objects = [(f"body {i}", body.name, body.friction) for i, body in enumerate(scene.bodies)]
    objects += [(f"wall {i}", wall.name, wall.friction) for i, wall in enumerate(scene.walls)]
    _check_names(table, objects)
    count, entered, surfaces, number = len(scene.bodies), frozenset().union(*table), dict[_Key, _Surface](), []
    for k, (label, name, own) in enumerate(objects):
        mu = None if own is None else not_negative(f"{label}: friction", own, COEFFICIENT)
        key = (k >= count, name if name in entered else None, mu)
        number.append(surfaces.setdefault(key, _Surface(len(surfaces), label, *key)).number)
    of_bodies = sum(not surface.wall for surface in surfaces.values())
    coefficient = np.zeros((len(surfaces), len(surfaces)))
    for a, b in combinations_with_replacement(surfaces.values(), 2):
        if not a.wall:
            coefficient[a.number, b.number] = coefficient[b.number, a.number] = _of_pair(a, b, table, default)
    surface = np.array(number[:count] + number[count:][::-1], dtype=np.int64)
    return Friction(surface, coefficient, of_bodies)


_Key = tuple[bool, str | None, float | None]


class _Surface(NamedTuple):
    number: int
    label: str  # of its first object
    wall: bool
    name: str | None  # if the table has it
    own: float | None  # coefficient of all its contacts


_Entries = dict[frozenset[str], float]  # by pairs of names


def _table(scene: Layout) -> tuple[_Entries, float | None]:
    """The entries by pairs of names, and the default, None without one."""
    if not isinstance(scene.friction, Mapping):
        return {}, not_negative("friction between bodies", scene.friction, COEFFICIENT)
    table: _Entries = {}
    for key, value in scene.friction.items():
        if key == DEFAULT:
            continue
        if not (isinstance(key, tuple) and len(key) == 2 and all(isinstance(name, str) for name in key)):
            raise SceneError(f"friction: {key!r} is not a pair of names; give a table as {EXAMPLE}")
        mu = not_negative(f"friction of {key}", value, COEFFICIENT)
        if table.setdefault(frozenset(key), mu) != mu:
            raise SceneError(f"friction of {key} is given twice, as {table[frozenset(key)]:g} and {mu:g}; keep one")
    default = scene.friction.get(DEFAULT)
    return table, None if default is None else not_negative("friction: default", default, COEFFICIENT)


def _of_pair(a: _Surface, b: _Surface, table: _Entries, default: float | None) -> float:
    if a.name is not None and b.name is not None and frozenset((a.name, b.name)) in table:
        return table[frozenset((a.name, b.name))]
    if a.own is not None and b.own is not None and a.own != b.own:
        raise SceneError(
            f"{a.label} gives friction = {a.own:g} and {b.label} {b.own:g} for their contact; give one of them, or"
            f" name both and enter the pair in a table, as Scene(friction={EXAMPLE})"
        )
    for value in (a.own, b.own, default):
        if value is not None:
            return value
    shown = " and ".join(s.label if s.name is None else f"{s.label} ({s.name!r})" for s in (a, b))
    raise SceneError(f"friction: the table has no entry for {shown} and no {DEFAULT!r}; add one of the two")


def _check_names(table: _Entries, objects: Iterable[tuple[str, object, object]]) -> None:
    known = set()
    for label, name, _ in objects:
        if name is not None and not isinstance(name, str):
            raise SceneError(f"{label}: name = {name!r}; give text, as 'gel', or None")
        known.add(name)
    for name in sorted(frozenset().union(*table) - known):
        borne = ", ".join(sorted(map(repr, known - {None}))) or "none"
        raise SceneError(f"friction: no body or wall has the name {name!r} of the table; names are {borne}")
