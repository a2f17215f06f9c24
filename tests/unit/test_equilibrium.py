"""Limit analysis of rigid bodies: textbook limits, Farkas' lemma by another solver, mechanisms in words."""

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.optimize import nnls

from skmpm.implicit.equilibrium import RigidContacts, describe, mechanism

FIXED = -1
WEIGHT, UP = np.array([0.0, -1.0, 0.0]), np.array([0.0, 1.0])


def touching(contacts, bodies=1, supports=None):
    """Contacts (body, other, arm on the body, arm on the other, normal towards the body, friction); radii are one."""
    rows = {"n": np.zeros((len(contacts), 3 * bodies)), "t": np.zeros((len(contacts), 3 * bodies))}
    for k, (a, b, arm, other, normal, _) in enumerate(contacts):
        n = np.array(normal) / np.hypot(*normal)
        for name, d in (("n", n), ("t", np.array([-n[1], n[0]]))):
            for body, x, sign in ((a, arm, 1.0), (b, other, -1.0)):
                if body >= 0:
                    rows[name][k, 3 * body : 3 * body + 3] = sign * np.array([*d, x[0] * d[1] - x[1] * d[0]])
    supports = np.zeros((0, 3 * bodies)) if supports is None else np.atleast_2d(supports)
    pairs = np.array([[c[0] for c in contacts], [c[1] for c in contacts]], dtype=int)
    friction = np.array([c[5] for c in contacts], dtype=float)
    return RigidContacts(pairs, sp.csr_array(rows["n"]), sp.csr_array(rows["t"]), friction, sp.csr_array(supports))


def block(friction, width=1.0, height=1.0):
    """A block on a floor, in the frame of the floor."""
    corners = [(s * width / 2, -height / 2) for s in (-1, 1)]
    return touching([(0, FIXED, x, None, (0, 1), friction) for x in corners])


def pull(angle):
    """Weight on a floor inclined by an angle."""
    return np.array([np.sin(angle), -np.cos(angle), 0.0])


@pytest.mark.parametrize("angle", [0.1, 0.5, 1.0])
def test_a_block_on_an_incline_slides_where_friction_is_less_than_the_slope(angle):
    slope = np.tan(angle)
    assert mechanism(pull(angle), block(1.01 * slope, width=10.0)) is None
    contacts = block(0.95 * slope, width=10.0)
    for few in (False, True):
        q = mechanism(pull(angle), contacts, few=few)
        assert q[0] > 0.0
        assert describe(q, contacts).verb == "slides"


@pytest.mark.parametrize("angle", [0.1, 0.5, 1.0])
def test_a_tall_block_topples_where_its_centre_is_beyond_its_corner(angle):
    """Width over height less than the slope, whatever the friction: it turns about its lower corner, downhill."""
    slope = np.tan(angle)
    assert mechanism(pull(angle), block(100.0, width=1.01 * slope)) is None
    contacts = block(100.0, width=0.95 * slope)
    q = mechanism(pull(angle), contacts, few=True)
    found = describe(q, contacts)
    assert q[2] < 0.0 and (found.body, found.verb, found.contact) == (0, "rotates", 1)


def test_a_disc_has_no_equilibrium_on_any_slope_and_rolls():
    contacts = touching([(0, FIXED, (0.0, -1.0), None, (0, 1), 1000.0)])
    assert mechanism(pull(0.0), contacts) is None
    q = mechanism(pull(0.01), contacts, few=True)
    assert q[0] == pytest.approx(-q[2], rel=1e-6)
    assert describe(q, contacts).verb == "rotates"


@pytest.mark.parametrize("angle", [0.6, 1.0, 1.3])
def test_a_ladder_on_a_smooth_wall_needs_friction_of_half_the_cotangent(angle):
    half, needed = 0.5 * np.array([np.cos(angle), np.sin(angle)]), 0.5 / np.tan(angle)

    def ladder(friction):
        return touching([(0, FIXED, -half, None, (0, 1), friction), (0, FIXED, half, None, (-1, 0), 0.0)])

    assert mechanism(WEIGHT, ladder(1.01 * needed)) is None
    assert mechanism(WEIGHT, ladder(0.99 * needed)) is not None


@pytest.mark.parametrize("angle", [0.6, 1.0])
def test_an_arch_of_two_rods_pushes_outwards_by_half_the_cotangent(angle):
    """Rods that lean on each other: each foot bears one weight, and W / (2 tan angle) to the side."""
    half, needed = 0.5 * np.array([np.cos(angle), np.sin(angle)]), 0.5 / np.tan(angle)
    mirror = np.array([-1.0, 1.0])

    def arch(friction):
        foot_points = [(0, FIXED, -half, None, (0, 1), friction), (1, FIXED, -half * mirror, None, (0, 1), friction)]
        return touching([*foot_points, (0, 1, half, half * mirror, (-1, 0), 0.0)], bodies=2)

    assert mechanism(np.tile(WEIGHT, 2), arch(1.01 * needed)) is None
    q = mechanism(np.tile(WEIGHT, 2), arch(0.99 * needed)).reshape(2, 3)
    assert q[0, 2] < 0.0 < q[1, 2]


def test_a_body_without_contacts_falls_and_what_supports_stop_does_not():
    free = touching([])
    q = mechanism(WEIGHT, free)
    assert describe(q, free) == describe(-q, free)
    assert describe(q, free).verb == "falls with no contact nearby"
    assert mechanism(WEIGHT, touching([], supports=[0.0, 1.0, 0.0])) is None
    assert mechanism(np.zeros(3), free) is None


def test_the_message_names_the_moving_body_and_not_the_one_that_carries_it():
    """A block slides on another one, which lies on a rough floor: body 1, on body 0."""
    floor = [(0, FIXED, (s, -0.5), None, (0, 1), 1.0) for s in (-5.0, 5.0)]
    contacts = touching([*floor, *[(1, 0, (s, -0.5), (s, 0.5), (0, 1), 0.2) for s in (-0.5, 0.5)]], bodies=2)
    found = describe(mechanism(np.tile(pull(0.3), 2), contacts, few=True), contacts)
    assert (found.body, found.verb) == (1, "slides") and found.contact in (2, 3)


@pytest.mark.parametrize("seed", range(60))
def test_a_mechanism_is_found_if_another_solver_finds_no_forces(seed):
    """Random contacts of three bodies: non-negative least squares over the edges of the cones, or a mechanism.

    Farkas' lemma: exactly one of the two exists. Cases within 1 % of the limit are left out.
    """
    rng = np.random.default_rng(seed)
    contacts = []
    for _ in range(rng.integers(3, 10)):
        a, b = rng.permutation([FIXED, FIXED, 0, 1, 2])[:2]
        if max(a, b) >= 0 and a != b:
            a, b = max(a, b), min(a, b)
            arms = rng.uniform(-1.0, 1.0, (2, 2))
            contacts.append((a, b, *arms, rng.normal(size=2) + UP, rng.choice([0.0, 0.4, 1.0])))
    contacts, load = touching(contacts, bodies=3), np.tile(WEIGHT, 3)
    edges = contacts.resisting.toarray()
    edges /= np.linalg.norm(edges, axis=1)[:, None]
    _, left = nnls(edges.T, -load, maxiter=10_000)
    if 1e-9 < left < 1e-2:
        pytest.skip("too close to the limit")
    for few in (False, True):
        q = mechanism(load, contacts, few=few)
        assert (q is None) == (left <= 1e-9)
        if q is not None:
            assert load @ q > 0.0
            assert (edges @ q).min() > -1e-6
