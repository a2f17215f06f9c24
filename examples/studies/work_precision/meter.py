"""Cost of a run: processor time, and counts that do not depend on the machine."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from time import process_time

import numpy as np
import scipy.sparse as sp

import skmpm
from skmpm import linear
from skmpm.linear.band import column_lengths, half_bandwidth

SIZES = ("unknowns", "points", "overlap")  # which are no sums: the largest counts


class TooLong(Exception):  # noqa: N818  (says what happened, as `StepFailed` does)
    """A run that used more processor time than it may."""


@dataclass(eq=False)
class Meter:
    """A linear solver that counts what it is asked for, and a clock for the steps."""

    solver: linear.Linear
    limit: float = 0.0  # processor time after which the steps end; 0: none
    seconds: float = 0.0  # processor time of the steps, and of nothing else
    steps: int = 0
    retries: int = 0
    newton: int = 0
    contact: int = 0  # iterations of the contact solver
    factorisations: int = 0
    work: float = 0.0  # sum over factorisations of unknowns * (half bandwidth)^2: what banded Cholesky multiplies
    unknowns: int = 0
    points: int = 0
    overlap: float = 0.0  # the largest
    _solves: list[int] = field(default_factory=list)  # iterations of every solve by multigrid
    _taken: dict[str, float] = field(default_factory=dict)  # the cost when it was asked for last
    _began: float | None = None  # processor time of this process at the begin of the step that is under way

    def __call__(self, A: sp.bsr_array, blocks: np.ndarray, rigid_motions: np.ndarray) -> linear.Solver:
        """As the solver does."""
        self.check()
        self.factorisations += 1
        self.unknowns = max(self.unknowns, A.shape[0])
        self.work += float(A.shape[0]) * half_bandwidth(column_lengths(A, blocks)) ** 2
        made = self.solver(A, blocks, rigid_motions)
        if isinstance(made, linear.Amg):
            made = replace(made, callback=self._solves.append)
        return made

    def states(
        self,
        scene: skmpm.Scene,
        *,
        dt: float | None,
        until: float,
        scheme: skmpm.Scheme,
        start: skmpm.State | None = None,
    ) -> Iterator[skmpm.State]:
        """As `skmpm.simulate`; times the steps and counts."""
        first = skmpm.initial(scene, scheme=scheme) if start is None else start
        self.points = int(first.x.shape[1])
        run = skmpm.simulate(scene, dt=dt, until=until, scheme=scheme, start=first)
        while True:
            self._began = process_time()
            try:
                state = next(run, None)
            finally:
                self.seconds += process_time() - self._began
                self._began = None
            if state is None:
                return
            self.count(state.report)
            self.check()
            yield state

    def check(self) -> None:
        """`TooLong` if the steps have used more processor time than they may; asked at every factorisation."""
        now = 0.0 if self._began is None else process_time() - self._began
        if self.limit and self.seconds + now > self.limit:
            raise TooLong(f"more than {self.limit:g} s")

    def count(self, report: skmpm.scene.Report) -> None:
        """Add what a step reports."""
        self.steps += 1
        self.retries += report.retries
        self.newton += report.newton
        self.contact += report.contact
        self.overlap = max(self.overlap, report.overlap)

    def cost(self) -> dict[str, float]:
        """All of it; `products` are those of multigrid's conjugate gradients with A."""
        names = ("seconds", "steps", "retries", "newton", "contact", "factorisations", "work", "unknowns", "points")
        counts = {name: float(getattr(self, name)) for name in (*names, "overlap")}
        return counts | {"products": float(sum(self._solves))}

    def taken(self) -> dict[str, float]:
        """The cost since this was asked for last; of sizes, what is known so far."""
        now, before = self.cost(), self._taken
        self._taken = now
        return {name: value - (0.0 if name in SIZES else before.get(name, 0.0)) for name, value in now.items()}
