"""Laws of the error, fitted to the runs around the presets: what `skmpm.suggest` goes by.

    error = c_h n^-p + c_s s^r + c_t tau^q,   n = R/h, s = spacing / h, tau = dt c / R

c is the speed of pressure waves. On quasi-static scenes there is no time and no third term.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import tradeoff_discs as discs
from numpy.typing import NDArray
from scipy.optimize import least_squares
from tradeoff_dials import DEFAULT
from tradeoff_results import Found, Run

Array = NDArray[np.float64]

TIMES = {  # dt c / R at pace 1
    "collision": discs.COLLISION_DT * discs.wave(discs.LAWS["finite"]) / discs.R,
    "packing": discs.PACKING_DT * discs.wave(discs.GELS["finite"]) / discs.MEAN,
}
STEERED = {"cells", "spacing", "pace"}
TIGHT = 1e-4
SMALLEST = 1e-6  # coefficient that counts as none
EXPONENTS = (0.5, 4.0)


@dataclass(frozen=True)
class Law:
    """Constants of the law for one quantity of a scene, and how well it holds."""

    scene: str
    quantity: str
    space: tuple[float, float]  # c_h, p
    points: tuple[float, float]  # c_s, r
    time: tuple[float, float]  # c_t, q
    runs: int
    scatter: float  # factor within which it holds, root mean square of logarithms
    worst: float  # the largest factor

    def __call__(self, n: Any, s: Any, tau: Any) -> Any:
        """The error."""
        (a, p), (b, r), (c, q) = self.space, self.points, self.time
        return a * n**-p + b * s**r + c * tau**q


def chosen(found: Found, scene: str) -> list[Run]:
    """Runs that differ from the default in `cells`, `spacing` and `pace` only."""
    runs = [
        r for r in found.runs.get(scene, {}).values() if np.isfinite(r.error) and r.whys & {"preset", "one", "slope"}
    ]
    return [r for r in runs if differing(r) <= STEERED]


def differing(run: Run) -> set[str]:
    """Dials that are not at their default; tolerances up to `TIGHT` make no difference that shows."""
    names = {name for name, level in run.setting.items() if level != DEFAULT[name]}
    return {name for name in names if not (name.endswith("_tol") and run.setting[name] <= TIGHT)}


def place(run: Run) -> tuple[float, float, float]:
    """Where a run is: n, s, tau."""
    setting = run.setting
    return setting["cells"], setting["spacing"], TIMES.get(run.scene, 0.0) * setting["pace"]


def fit(found: Found, scene: str, quantity: str) -> Law | None:
    """The law of a quantity, by least squares of logarithms; None of fewer runs than constants."""
    runs = [r for r in chosen(found, scene) if r.errors.get(quantity, 0.0) > 0.0]
    if len(runs) < 8:
        return None
    n, s, tau = np.array([place(r) for r in runs]).T
    error = np.array([r.errors[quantity] for r in runs])
    timed = scene in TIMES

    def law_of(p: Array) -> Law:
        coefficients = np.exp(p[:3]) * [1.0, 1.0, float(timed)]
        space, points, time = zip(coefficients.tolist(), p[3:].tolist(), strict=True)
        return Law(scene, quantity, space, points, time, len(runs), 1.0, 1.0)

    def off(p: Array) -> Array:
        return np.asarray(np.log(law_of(p)(n, s, np.maximum(tau, 1e-12)) / error))

    low = np.append(np.full(3, np.log(SMALLEST)), np.full(3, EXPONENTS[0]))
    high = np.append(np.full(3, np.log(1e3)), np.full(3, EXPONENTS[1]))
    starts = [
        np.append(np.log([error.max() * 5.0**p, share * error.min(), share * error.min()]), [p, 1.5, 1.0])
        for p in (1.0, 2.0)
        for share in (0.1, 1.0)
    ]
    options = {"bounds": (low, high), "loss": "soft_l1"}
    best = min((least_squares(off, np.clip(x, low, high), **options) for x in starts), key=lambda t: t.cost)
    rest = off(best.x)
    scatter, worst = np.exp([np.sqrt(np.mean(rest**2)), np.abs(rest).max()]).tolist()
    return replace(law_of(best.x), scatter=scatter, worst=worst)


def quantities(found: Found, scene: str) -> list[str]:
    """What is measured on a scene, the largest last."""
    runs = chosen(found, scene)
    return list(runs[0].errors) if runs else []
