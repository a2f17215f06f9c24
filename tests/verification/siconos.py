"""Three public contact problems of Siconos, solved by the library and by a plain Gauss-Seidel method.

`python tests/verification/siconos.py FOLDER` reads the files fc2d_granularflowonwall_*.dat in the folder
numerics/src/FrictionContact/test/data of a copy of Siconos (github.com/siconos/siconos, Apache License 2.0), and
writes what it measures to docs/verification/siconos/contacts.csv, in half a minute. Rigid discs flow on a wall,
mu = 0.5. The files of Siconos are no part of this repository.
"""

import csv
import sys
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from time import process_time

import numpy as np
import scipy.sparse as sp
from contact_laws import violation
from numba import njit
from scipy.sparse.linalg import eigsh

from skmpm import coulomb

TABLE = Path(__file__).resolve().parents[2] / "docs" / "verification" / "siconos" / "contacts.csv"
NAMES = ("00667_00000", "02020_00213", "07002_00801")
TOL, ROUGH = 1e-10, 1e-6
SWEEPS, EVERY = 10_000, 10  # Siconos' own test asks for 1e-5 in as many sweeps; the laws are checked after every ten
REPEATS = 3  # the shortest time of so many counts


def read(path):
    """W, q and mu of a file in Siconos' text format with a sparse matrix; rows n, t of each contact.

    The matrix is printed column by column with six digits, and symmetric to these: the mean of both halves is taken.
    """
    rows, columns, values, vectors, column = [], [], [], [], None
    for line in path.read_text().splitlines():
        words = line.split()
        if words[:1] == ["col"]:
            column = int(words[1])
        elif column is not None and words[1:2] == [":"]:
            rows.append(int(words[0]))
            columns.append(column)
            values.append(float(words[2]))
        elif column is not None:
            vectors.append(np.array(words, dtype=float))
    q, mu = vectors
    W = sp.csr_array((values, (rows, columns)), shape=(q.size, q.size))
    return sp.csr_array(0.5 * (W + W.T)), q, mu


@njit
def sweep(data, indices, indptr, q, mu, r):
    """Change r: each contact in its turn takes the normal and then the tangential impulse that obey its own laws."""
    for i in range(q.size):
        u, diagonal = q[i], 0.0
        for at in range(indptr[i], indptr[i + 1]):
            u += data[at] * r[indices[at]]
            if indices[at] == i:
                diagonal += data[at]
        least, most = 0.0, np.inf
        if i % 2:
            most = mu[i // 2] * r[i - 1]
            least = -most
        r[i] = min(max(r[i] - u / diagonal, least), most)


def gauss_seidel(W, q, mu, *, tol, sweeps=SWEEPS):
    """Impulses that violate the laws least, after how many sweeps, and their time [ms]; rows n, t of each contact."""
    r, best, least, at, took = np.zeros_like(q), np.zeros_like(q), np.inf, 0, 0.0
    sweep(W.data, W.indices, W.indptr, q, mu, r.copy())  # compiles
    for done in range(EVERY, sweeps + 1, EVERY):
        began = process_time()
        for _ in range(EVERY):
            sweep(W.data, W.indices, W.indptr, q, mu, r)
        took += 1e3 * (process_time() - began)
        worst = violation(W, q, mu, r)
        if worst < least:
            best, least, at = r.copy(), worst, done
        if worst < tol:
            break
    return best, at, took


@dataclass(frozen=True)
class Line:
    """What is kept of one problem."""

    contacts: int
    steps: int  # Newton steps to TOL
    violation: float  # of the laws then, over |q|
    milliseconds: float
    rough_milliseconds: float  # of the same to ROUGH
    sweeps: int  # of Gauss-Seidel to ROUGH
    sweep_milliseconds: float
    least: float  # violation that Gauss-Seidel reaches in SWEEPS
    lowest: float  # eigenvalue of W over the highest

    @property
    def ratio(self):
        """Time of Newton's method over that of Gauss-Seidel, both to ROUGH."""
        return self.rough_milliseconds / self.sweep_milliseconds


def newton(W, q, mu, tol):
    """Impulses, Newton steps and time [ms]."""
    times = []
    for _ in range(REPEATS):
        began = process_time()
        r, info = coulomb.solve(W, q, mu, tol=tol)
        times.append(1e3 * (process_time() - began))
    return r, info.iterations, min(times)


def measure(W, q, mu):
    """Solve one problem both ways."""
    newton(W, q, mu, ROUGH)  # compiles
    *_, rough = newton(W, q, mu, ROUGH)
    r, steps, took = newton(W, q, mu, TOL)
    trials = [gauss_seidel(W, q, mu, tol=ROUGH)[1:] for _ in range(REPEATS)]
    best, *_ = gauss_seidel(W, q, mu, tol=0.0)
    sweeps, swept = min(trials)
    high = eigsh(W, 1, which="LA", return_eigenvectors=False)[0]
    lowest = float(eigsh(sp.csc_array(W), 1, sigma=-1e-4 * high, return_eigenvectors=False)[0] / high)
    return Line(mu.size, steps, violation(W, q, mu, r), took, rough, sweeps, swept, violation(W, q, mu, best), lowest)


def kept():
    """What was measured last."""
    with TABLE.open(newline="") as file:
        return [
            Line(*(int(row[f.name]) if f.type is int else float(row[f.name]) for f in fields(Line)))
            for row in csv.DictReader(file)
        ]


def main(folder):
    """Measure all problems and keep the figures."""
    lines = [measure(*read(folder / f"fc2d_granularflowonwall_{name}.dat")) for name in NAMES]
    with TABLE.open("w", newline="") as file:
        writer = csv.DictWriter(file, [f.name for f in fields(Line)], lineterminator="\n")
        writer.writeheader()
        writer.writerows({k: f"{v:.4g}" for k, v in asdict(line).items()} for line in lines)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
