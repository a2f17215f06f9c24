"""The figures of docs/studies/packing_ensemble.md, drawn from the members of the study."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from . import ensembles, snapshots
from .curves import Study
from .drawing import save


def draw(found: Study, folder: Path) -> dict[str, str]:
    """Draw what the members allow; captions by file. Pictures of states that are gone stay as they are."""
    folder.mkdir(parents=True, exist_ok=True)
    captions = {}
    for name, (picture, caption) in PICTURES.items():
        try:
            figure = picture(found)
        except snapshots.StatesGoneError:
            captions |= {name: caption} if (folder / name).exists() else {}
            continue
        if save(figure, folder / name):
            captions[name] = caption
    return captions


PICTURES: dict[str, tuple[Callable[[Study], Figure | None], str]] = {
    "figure2.png": (
        ensembles.figure2,
        "Contact surface, anisotropy and aspect ratio at 2 m/s (above) and quasi-static (below): means over the "
        "packings with standard errors. Black: fits of breaks. Dashed: R/h = 8.",
    ),
    "figure4.png": (
        partial(snapshots.figure4, kind="fast"),
        "Stages at 2 m/s without (above) and with friction (below): discs by pressure over E*, lines as wide as the "
        "force over the mean of the picture.",
    ),
    "figure4_quasistatic.png": (
        partial(snapshots.figure4, kind="quasistatic"),
        "The same packings squeezed quasi-statically.",
    ),
    "pressure.png": (
        ensembles.pressure,
        "Left: pressure, uniaxial (lines with bands), isotropic (dashed) and at 2 m/s (dotted); black: the law of "
        "compaction. Right: the interior of each packing near jamming, with the lines that give Φ_J (black).",
    ),
    "coordination.png": (
        ensembles.coordination,
        "Left: coordination without rattlers, uniaxial (lines with bands) and isotropic (dashed), and with rattlers "
        "(dotted). Right: the interior of each packing without friction; black: 3.6 ± 0.5 times the root.",
    ),
    "kinds.png": (
        ensembles.kinds,
        "Ratios of mean pressures: isotropic over uniaxial, 2 m/s over quasi-static, R/h = 8 over R/h = 5 (the same "
        "packings).",
    ),
    "materials.png": (
        ensembles.materials,
        "Without friction: P/E* of three Poisson's ratios by current (lines) and nominal (dotted) solid fraction, "
        "and over that of 0.45 by current one (the same packings).",
    ),
    "rates.png": (
        ensembles.rates,
        "The first packing under three quasi-static lids: pressure over the mean of all packings (grey: their "
        "standard deviation), and coordination without rattlers less their mean.",
    ),
    "artefact.png": (
        ensembles.artefact,
        "Interior pressure where it first resists: left with contact at shared nodes, right at outlines. "
        "Vertical lines: the formula at rest (dashed) and at 2 m/s (dotted); dots: first changes.",
    ),
    "forgetting.png": (
        ensembles.forgetting,
        "What forgetting stress at cell crossings does to the pressure: the same packing, friction 0.5, 2 m/s.",
    ),
}
