"""`Run`: what a member of a sweep runs, and the rows it leaves."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from skmpm.observe import observe
from skmpm.scene import Scene, State
from skmpm.scheme import Scheme
from skmpm.simulation import CHECKPOINT_EVERY
from skmpm.simulation import simulate as run_scene

Value = float | int | bool | str
Row = Mapping[str, Value]
Rows = Sequence[Row]


def observables(scene: Scene, state: State) -> dict[str, Value]:
    """The numbers of `observe`, as `Observables.table` names them: what a `Run` observes unless told otherwise."""
    return {**observe(scene, state).table()}


@dataclass(frozen=True, eq=False)
class Run:
    """What a member of a `sweep` runs; the function `build` of the sweep returns it.

    Parameters
    ----------
    scene : the scene, built where it runs, so that it may hold functions
    until : time at which it ends [s]
    dt : length of the steps [s]; None: steps are chosen, as by `simulate`
    scheme : how steps are solved; with ``threads=None`` the members divide the cores among them
    start : state to begin with, None for the initial one
    observe : f(scene, state) that returns a row of the table, values (numbers or texts) by name; the column ``t``
        precedes them. It may depend on nothing but its arguments: rows are observed again after an interruption
    every : simulated time between rows [s]; 0: a row for every step. The last state always has one
    stop : f(row) that is true where the run ends before `until`
    keep : f(row) by name; the first state whose row makes it true is kept as ``<name>.checkpoint``
    then : f(state) of the last state, which returns the `Run` of the next stage; that begins with this state
        (`continued`) and has the same columns. None: there is no other stage
    checkpoint : wall time between checkpoints [s]
    simulate : function that yields the states, called as `simulate` is

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> scene = skmpm.Scene([body], cell=4e-4, gravity=(0, -9.81))
    >>> run = skmpm.Run(scene, until=1e-2, dt=1e-3, every=5e-3)
    >>> run.until, run.every
    (0.01, 0.005)
    """

    scene: Scene
    until: float
    dt: float | None = None
    scheme: Scheme = Scheme()  # noqa: RUF009
    start: State | None = None
    observe: Callable[[Scene, State], Row] = observables
    every: float = 0.0
    stop: Callable[[Row], bool] | None = None
    keep: Mapping[str, Callable[[Row], bool]] = field(default_factory=dict)
    then: Callable[[State], Run] | None = None
    checkpoint: float = CHECKPOINT_EVERY
    simulate: Callable[..., Iterable[State]] = run_scene

    def __post_init__(self) -> None:
        """Refuse what could fail only after hours."""
        if not isinstance(self.scene, Scene):
            raise TypeError(f"Run: expected a Scene, got a {type(self.scene).__name__}")
        for name in ("every", "checkpoint"):
            if not getattr(self, name) >= 0.0:
                raise ValueError(f"Run: {name} = {getattr(self, name)}; give a time in seconds, 0 for every step")
        for name in self.keep:
            if not re.fullmatch(r"(?!last$|end_)[A-Za-z0-9][A-Za-z0-9_.-]*", name):
                raise ValueError(f"Run: keep: {name!r} names no file; use letters, digits, . _ -, not last or end_")


def row_due(every: float, state: State) -> bool:
    """Whether a multiple of `every` lies in the last step of the state, which decides it alone."""
    if every == 0.0:
        return True
    now, before = state.t / every + 1e-9, (state.t - state.report.dt) / every + 1e-9
    return bool(np.floor(now) > np.floor(before))


def checked(row: Row, reserved: frozenset[str]) -> dict[str, Value]:
    """The row with plain values; TypeError or ValueError if a table cannot hold it beside the `reserved` columns."""
    if not isinstance(row, Mapping):
        raise TypeError(f"a row of the table is a {type(row).__name__}; observe and build return values by name")
    for name in sorted(reserved & row.keys()):
        raise ValueError(f"the table has a column {name!r} already, of parameters or of the sweep; rename it")
    return {str(name): _plain(str(name), value) for name, value in row.items()}


def _plain(name: str, value: object) -> Value:
    if isinstance(value, np.generic) or (isinstance(value, np.ndarray) and value.ndim == 0):
        value = value.item()
    if isinstance(value, str):
        return re.sub(r"[\r\n]+", " ", value)  # a line of the table is a row
    if isinstance(value, bool | int | float):
        return value
    raise TypeError(f"the value of {name!r} in a row is a {type(value).__name__}; rows hold numbers and texts")
