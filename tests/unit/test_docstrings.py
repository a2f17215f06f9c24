"""What `help` says of public classes: fields of results, and energies of materials."""

from dataclasses import fields

import numpy as np
import pytest

import skmpm
from skmpm.sweep import Member


@pytest.mark.parametrize(
    "kind",
    [
        skmpm.Suggestion,
        skmpm.Preflight,
        skmpm.Packing,
        skmpm.Points,
        skmpm.coulomb.Info,
        skmpm.Network,
        skmpm.Traction,
        skmpm.Run,
        skmpm.Sweep,
        Member,
    ],
)
def test_every_field_is_described(kind):
    described = kind.__doc__.partition("Attributes\n")[2]
    assert [f.name for f in fields(kind)] == [
        line.split(" : ")[0].strip() for line in described.splitlines() if " : " in line
    ]


RUBBERS = (
    skmpm.MooneyRivlin(1e5, 2e4, 2e6, 1000.0),
    skmpm.Yeoh(1e5, -1e4, 1e3, 2e6, 1000.0),
    skmpm.Ogden((1e5,), (2.0,), 2e6, 1000.0),
)


@pytest.mark.parametrize("material", RUBBERS, ids=lambda m: type(m).__name__)
def test_the_volumetric_energy_of_rubbers_is_that_of_their_docstrings(material):
    """Equal stretches in all directions are not possible in plane strain: the isochoric energies are subtracted."""
    assert "kappa/4 (J^2 - 1 - 2 ln J)" in type(material).__doc__
    J = 1.3
    F = np.diag([np.sqrt(J), np.sqrt(J)])[:, :, None]
    l = np.array([J**0.5, J**0.5, 1.0]) * J ** (-1 / 3)  # noqa: E741
    first, second = np.sum(l**2) - 3.0, np.sum(l**-2) - 3.0
    iso = {
        "MooneyRivlin": 1e5 * first + 2e4 * second,
        "Yeoh": 1e5 * first - 1e4 * first**2 + 1e3 * first**3,
        "Ogden": 1e5 / 2.0 * first,
    }[type(material).__name__]
    volumetric = 2e6 / 4.0 * (J**2 - 1.0 - 2.0 * np.log(J))
    assert material.energy(F)[0] == pytest.approx(iso + volumetric, rel=1e-12)
