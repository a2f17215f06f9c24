"""Common parts of all verifications: a row of the table in docs/verification, norms and rates."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Row:
    """One line of the table: what was solved, against what, how fine, how far off."""

    problem: str
    reference: str  # closed form, FEM, literature
    h: str  # grids, as "1/8, 1/16, 1/32" or "R/h = 5, 10"
    error: str  # on these grids, with what it is relative to; `tabulated` where it is a table
    rate: str  # measured order; "-" where there is none
    goal: str  # what was asked, and "missed: why" where it was missed
    test: str  # name of the test that asserts it


def rate(h, error):
    """The order of convergence: the slope of log error over log h, by least squares."""
    return float(np.polyfit(np.log(h), np.log(error), 1)[0])


def relative(value, exact, weight):
    """Relative L2 error of values (..., n) at points of weights (n,)."""
    return float(np.sqrt(np.sum(weight * (value - exact) ** 2) / np.sum(weight * exact**2)))


def texts(values, digits=2):
    """Values as texts."""
    return [f"{value:.{digits}g}" for value in values]


def numbers(values, digits=2):
    """Values as text, separated by commas."""
    return ", ".join(texts(values, digits))


def tabulated(heads, lines):
    """A table as one text: heads of its columns, and its lines {label: cells}; the only label may be empty."""
    return " | ".join(heads) + " || " + "; ".join(f"{label}: {' | '.join(line)}" for label, line in lines.items())
