"""Schemes: invalid parameters are refused with their name, the value and the remedy."""

from dataclasses import FrozenInstanceError, fields, replace

import numpy as np
import pytest

from skmpm import contact, linear
from skmpm.material import LinearElastic, NeoHookean
from skmpm.scheme import NEARLY_INCOMPRESSIBLE, Scheme, averages_dilatation

BAD = [
    ({"theta": 0.49}, r"theta = 0.49.*between 1/2"),
    ({"theta": 1.01}, r"theta = 1.01.*between 1/2"),
    ({"theta": np.nan}, r"theta = nan.*between 1/2"),
    ({"theta": "implicit"}, r"theta = 'implicit'.*between 1/2"),
    ({"theta": None}, r"theta = None.*between 1/2"),
    ({"anchor": -1.0}, r"anchor = -1.0.*0 \(every step\)"),
    ({"anchor": np.nan}, r"anchor = nan.*0 \(every step\)"),
    ({"ghost": -0.005}, r"ghost = -0.005.*about 0.005"),
    ({"newton_tol": 0.0}, r"newton_tol = 0.0.*about 1e-3"),
    ({"contact_tol": 1.0}, r"contact_tol = 1.0.*about 1e-6"),
    ({"gap_tol": np.inf}, r"gap_tol = inf.*about"),
    ({"max_newton": 0}, r"max_newton = 0.*about 60"),
    ({"max_newton": 2.5}, r"max_newton = 2.5.*whole number"),
    ({"contact": "outlines"}, r"contact = 'outlines'.*contact.point_to_curve"),
    ({"contact": None}, r"contact = None.*contact.point_to_curve"),
    ({"linear": "banded"}, r"linear = 'banded'.*linear.banded"),
    ({"contact": contact.shared_grid}, r"shared_grid with anchor = inf.*anchor = 0"),
    ({"contact": contact.shared_grid, "anchor": 0.1}, r"shared_grid with anchor = 0.1.*anchor = 0"),
]


@pytest.mark.parametrize(("choice", "message"), BAD, ids=[m for _, m in BAD])
def test_bad_choices_are_refused_with_value_and_remedy(choice, message):
    with pytest.raises(ValueError, match=f"Scheme: .*{message}"):
        Scheme(**choice)


def test_the_limits_themselves_are_allowed():
    for choice in ({"theta": 0.5}, {"theta": 1}, {"anchor": 0}, {"ghost": 0.0}, {"max_newton": 1}):
        Scheme(**choice)
    Scheme(contact=contact.shared_grid, anchor=0.0)


def test_the_default_is_point_to_curve_contact_on_grids_built_once():
    scheme = Scheme()
    assert (scheme.theta, scheme.anchor, scheme.contact) == (1.0, np.inf, contact.point_to_curve)
    assert scheme.linear is linear.default


def test_nezamabadi2017_is_shared_grid_contact_with_regridding_at_every_step():
    seed = Scheme.nezamabadi2017()
    assert (seed.anchor, seed.contact) == (0.0, contact.shared_grid)
    assert seed.moment_fitting is seed.mean_dilatation is False
    others = {f.name for f in fields(Scheme)} - {"anchor", "contact", "moment_fitting", "mean_dilatation"}
    assert all(getattr(seed, name) == getattr(Scheme(), name) for name in others)


def test_schemes_are_frozen_and_compare_by_value():
    assert Scheme() == Scheme()
    assert Scheme(theta=0.5) != Scheme()
    with pytest.raises(FrozenInstanceError):
        Scheme().theta = 0.5
    with pytest.raises(TypeError):
        Scheme(0.5)


def test_gaps_cannot_be_better_than_the_contact_solves():
    with pytest.raises(ValueError, match=r"gap_tol = 1e-08 is below contact_tol = 1e-06"):
        Scheme(gap_tol=1e-8)
    Scheme(gap_tol=1e-8, contact_tol=1e-9)


def test_mean_dilatation_is_yes_or_no_or_by_the_material():
    """By Poisson's ratio from 0.4 on, whatever rounding its Lame constants suffer."""
    assert Scheme().mean_dilatation is None
    assert Scheme(mean_dilatation=np.False_, inertia=0).mean_dilatation is False is Scheme(inertia=0).inertia
    with pytest.raises(ValueError, match=r"mean_dilatation = 'mean'; use True, False, or None \(by the material\)"):
        Scheme(mean_dilatation="mean")
    for law in (LinearElastic, NeoHookean):
        for nu in (-0.5, 0.0, 0.3, 0.399, 0.4, 0.45, 0.49, 0.4999999):
            material = law(0.7, nu, 1.0)
            chosen = [averages_dilatation(Scheme(mean_dilatation=choice), material) for choice in (None, True, False)]
            assert chosen == [nu >= 0.4, True, False], nu
    assert NEARLY_INCOMPRESSIBLE == 0.4


def test_presets_differ_in_the_tolerance_of_the_balance_alone_and_take_other_choices():
    """Balanced is the default, fast leaves ten times its imbalance, accurate a thousandth."""
    fast, balanced, accurate = Scheme.fast(), Scheme.balanced(), Scheme.accurate()
    assert balanced == Scheme()
    assert (fast.newton_tol, balanced.newton_tol, accurate.newton_tol) == (1e-2, 1e-3, 1e-6)
    assert replace(fast, newton_tol=1e-3) == replace(accurate, newton_tol=1e-3) == balanced
    for preset in (Scheme.fast, Scheme.balanced, Scheme.accurate):
        assert replace(preset(inertia=False, newton_tol=1e-4), inertia=True) == Scheme(newton_tol=1e-4)
