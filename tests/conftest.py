"""Floating-point errors raise in every test; its log level ends with it; hypothesis is deterministic in CI.

And `filled`, how many entries the matrices of contact problems have.
"""

import logging
import os

import numpy as np
import pytest
from hypothesis import settings

from skmpm import coulomb

settings.register_profile("ci", derandomize=True, deadline=None)
settings.register_profile("local", deadline=None)
settings.register_profile(
    "nightly", deadline=None, max_examples=1000, print_blob=True
)  # --hypothesis-profile=nightly
settings.load_profile("ci" if os.environ.get("CI") else "local")


@pytest.fixture(autouse=True)
def strict_arithmetic():
    with np.errstate(all="raise", under="ignore"):
        yield


@pytest.fixture(autouse=True)
def same_log_level():
    """Scripts that tests run in their own process may silence the library."""
    logger = logging.getLogger("skmpm")
    level = logger.level
    yield
    logger.setLevel(level)


@pytest.fixture
def filled(monkeypatch):
    """Entries of W and rows of the contacts of every contact problem that is solved, in a list of pairs."""
    found, original = [], coulomb.solve

    def solve(W, q, *arguments, **options):
        found.append((W.nnz, q.size))
        return original(W, q, *arguments, **options)

    monkeypatch.setattr(coulomb, "solve", solve)
    return found
