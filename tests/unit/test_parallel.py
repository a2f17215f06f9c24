"""Threads: every body once, results equal to the bit, errors of threads raised."""

import threading
import time
from itertools import pairwise
from multiprocessing import get_context

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given
from hypothesis import strategies as st

import skmpm
from skmpm import linear, parallel
from skmpm.linear.band import banded


@given(st.lists(st.integers(0, 5000), min_size=1, max_size=40), st.integers(1, 5))
def test_every_body_is_in_exactly_one_range(sizes, count):
    offsets, seen = np.append(0, np.cumsum(sizes)), []
    with parallel.threads(count):
        parallel.over_bodies(lambda first, last: seen.extend(range(first, last)), offsets)
    assert sorted(seen) == list(range(len(sizes)))


@given(st.integers(0, 50_000), st.integers(1, 5))
def test_every_point_is_in_exactly_one_range_and_ranges_begin_at_whole_vectors(size, count):
    seen = []
    with parallel.threads(count):
        parallel.over_points(lambda first, last: seen.append((first, last)), size)
    seen.sort()
    assert seen[0][0] == 0 and seen[-1][1] == size
    assert all(last == first for (_, last), (first, _) in pairwise(seen))
    assert all(first % 64 == 0 for first, _ in seen)


def test_no_range_is_empty_where_one_body_is_most_of_all():
    seen = []
    with parallel.threads(3):
        parallel.over_bodies(lambda first, last: seen.append((first, last)), np.array([0, 100, 200, 40_200, 40_300]))
    assert all(first < last for first, last in seen) and len(set(seen)) == len(seen) > 1


def test_other_threads_work_while_one_is_busy():
    offsets, owners = np.arange(0, 200_000, 10_000), []

    def work(first, last):
        time.sleep(0.02)
        owners.append(threading.get_ident())

    with parallel.threads(2):
        parallel.over_bodies(work, offsets)
    assert len(set(owners)) == 2 and threading.get_ident() in owners
    with parallel.threads(1):
        parallel.over_bodies(work, offsets)
    assert owners[-1] == threading.get_ident()


def test_an_error_in_any_range_is_raised():
    def work(first, last):
        if last == 19:
            raise FloatingPointError("of the last body")

    with parallel.threads(3), pytest.raises(FloatingPointError, match="of the last body"):
        parallel.over_bodies(work, np.arange(0, 200_000, 10_000))


def test_a_forked_process_has_threads_of_its_own():
    offsets, seen = np.arange(0, 200_000, 10_000), []
    with parallel.threads(2):
        parallel.over_bodies(lambda first, last: seen.append(first), offsets)
        child = get_context("fork").Process(target=parallel.over_bodies, args=(lambda a, b: None, offsets))
        child.start()
        child.join(20.0)
    assert child.exitcode == 0


def squeezed(threads):
    """Twelve discs in a box after five steps."""
    placed = skmpm.packing(np.full(12, 1e-3), 8e-3, solid_fraction=0.7, seed=1)
    gel = skmpm.NeoHookean(1e6, 0.45, 1000.0)
    bodies = [skmpm.Body(skmpm.disc(c, 1e-3, spacing=0.11e-3), gel) for c in placed.centres.T]
    walls = [
        skmpm.Wall((0.0, 0.0), (0.0, 1.0)), skmpm.Wall((0.0, placed.height), (0.0, -1.0), velocity=(0.0, -10.0)),
        skmpm.Wall((0.0, 0.0), (1.0, 0.0)), skmpm.Wall((8e-3, 0.0), (-1.0, 0.0)),
    ]  # fmt: skip
    scene = skmpm.Scene(bodies, cell=0.15e-3, walls=walls, friction=0.5)
    *_, state = skmpm.simulate(scene, dt=1e-5, until=5e-5, scheme=skmpm.Scheme(threads=threads))
    return state


def test_results_do_not_depend_on_the_number_of_threads():
    one, *others = (squeezed(threads) for threads in (1, 2, 3))
    assert one.contacts.force[0].max() > 0.0
    for other in others:
        for name in ("x", "v", "F", "stress"):
            assert np.array_equal(getattr(one, name), getattr(other, name)), name
        assert np.array_equal(one.contacts.force, other.contacts.force)


@pytest.mark.parametrize("wrong", [0, -1, 1.5, "two"])
def test_a_wrong_number_of_threads_is_refused(wrong):
    with pytest.raises(ValueError, match=r"Scheme: threads = .*; use a number of at least 1, or None for all cores"):
        skmpm.Scheme(threads=wrong)


@given(st.integers(0, 1000), st.integers(1, 40), st.integers(1, 12))
def test_banded_cholesky_finds_the_factor(seed, nodes, reach):
    """Rows of random length, as those of a round body: the factor of numpy, and zeros left out beyond its profile."""
    rng = np.random.default_rng(seed)
    distance = np.subtract.outer(np.arange(nodes), np.arange(nodes))
    near = (distance >= 0) & (distance <= rng.integers(0, reach, nodes)[:, None])
    L = np.tril(np.kron(near, np.ones((2, 2))) * rng.normal(size=(2 * nodes, 2 * nodes)) / reach)
    np.fill_diagonal(L, rng.uniform(1.0, 2.0, 2 * nodes))
    A = np.asarray(L @ L.T)
    factor = banded(sp.bsr_array(A, blocksize=(2, 2)), np.array([0, 2 * nodes]), np.zeros((2 * nodes, 3)))
    band, found = factor.bands[0].reshape(2 * nodes, -1), np.zeros_like(L)
    for j in range(2 * nodes):
        found[j : factor.ends[j // 2], j] = band[j, : factor.ends[j // 2] - j]
    np.testing.assert_allclose(found, np.linalg.cholesky(A), rtol=1e-9, atol=1e-12)


@given(st.integers(0, 1000), st.lists(st.integers(0, 12), min_size=1, max_size=5), st.integers(1, 6))
def test_banded_solutions_of_bodies_of_any_size_and_bandwidth(seed, nodes, reach):
    """Sizes around the number of columns that substitutions take at once, one right-hand side and three."""
    rng = np.random.default_rng(seed)
    blocks = 2 * np.append(0, np.cumsum(nodes))
    node = np.arange(blocks[-1]) // 2
    body = np.searchsorted(blocks[1:], 2 * node, side="right")
    near = (np.abs(np.subtract.outer(node, node)) < reach) & np.equal.outer(body, body)
    A = rng.uniform(-1.0, 1.0, near.shape) * near
    A = A + A.T + 8.0 * reach * np.eye(node.size)
    solve = linear.banded(sp.bsr_array(A, blocksize=(2, 2)), blocks, np.zeros((node.size, 3)))
    for b in (rng.normal(size=node.size), rng.normal(size=(node.size, 3))):
        np.testing.assert_allclose(A @ solve(b), b, atol=1e-13)


def test_a_band_that_is_too_wide_is_refused():
    far = sp.csr_array(([1.0], ([2200], [0])), shape=(2201, 2201))
    A = sp.bsr_array(sp.kron(sp.eye_array(2201) * 3.0 + far + far.T, np.eye(2), format="csr"), blocksize=(2, 2))
    with pytest.raises(ValueError, match=r"half bandwidth 4401, at most 4160; use linear.amg"):
        linear.banded(A, np.array([0, 4402]), np.zeros((4402, 3)))
