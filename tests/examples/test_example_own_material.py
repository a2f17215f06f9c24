"""The example of a material of one's own, and the page that explains it."""

from pathlib import Path

import pytest

import skmpm
from examples import own_material

PAGE = Path(__file__).parents[2] / "docs" / "how_to" / "own_material.md"


def test_own_material(tmp_path, capsys):
    """The foam keeps more of its volume than rubber of the same small-strain constants, at the same height."""
    scene, state = own_material.main(tmp_path)
    left, right = (state.volume[state.body == b].sum() / scene.bodies[b].points.volume.sum() for b in (0, 1))
    assert left > right + 0.01
    assert f"area kept: foam {left:.4f}, rubber {right:.4f}" in capsys.readouterr().out
    assert right == pytest.approx(0.87, abs=0.01)
    assert (tmp_path / "own_material.png").stat().st_size > 1000


def test_the_material_with_memory_of_the_page_passes_its_check_and_softens(capsys):
    """Its code runs as it stands; a pressed disc of it loses stiffness and dissipates."""
    names: dict = {}
    exec(PAGE.read_text().split("```python")[2].split("```")[0], names)
    assert "update keeps what it gave" in capsys.readouterr().out
    damage = names["Damage"](E=1e6, strength=2e4, density=1000.0)
    plate = skmpm.Wall((0.0, 1e-2), (0.0, -1.0), velocity=(0.0, -0.5))
    body = skmpm.Body(skmpm.disc((0.0, 0.0), 1e-2, spacing=2e-3), damage)
    scene = skmpm.Scene([body], cell=4e-3, walls=[plate, skmpm.Wall((0.0, -1e-2), (0.0, 1.0))])
    *_, state = skmpm.simulate(scene, dt=5e-5, until=2e-3)
    assert state.internal.shape[0] == 1
    assert state.internal.min() < 0.9
    assert state.report.energy.plastic > 0.0


def test_the_material_of_the_page_passes_its_check_and_moves(capsys):
    """Its code runs as it stands; its solid is pressed by a plate and pushes back."""
    names: dict = {}
    exec(PAGE.read_text().split("```python")[1].split("```")[0], names)
    assert "tangent is symmetric" in capsys.readouterr().out
    foam = names["BlatzKo"](mu=1e5, density=200.0, viscosity=10.0)
    plate = skmpm.Wall((0.0, 1e-2), (0.0, -1.0), velocity=(0.0, -0.5))
    body = skmpm.Body(skmpm.disc((0.0, 0.0), 1e-2, spacing=2e-3), foam)
    scene = skmpm.Scene([body], cell=4e-3, walls=[plate, skmpm.Wall((0.0, -1e-2), (0.0, 1.0))])
    for mean_dilatation in (False, True):
        scheme = skmpm.Scheme(mean_dilatation=mean_dilatation)
        *_, state = skmpm.simulate(scene, dt=5e-5, until=2e-3, scheme=scheme)
        assert state.wall_force[0, 1] > 50.0
        assert state.report.energy.viscous > 0.0
