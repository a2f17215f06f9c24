"""Floating-point errors raise in every test; its log level ends with it; hypothesis is deterministic in CI."""

import logging
import os

import numpy as np
import pytest
from hypothesis import settings

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
