"""Examples leave their figures open, as notebooks and the gallery want them; each test closes them."""

import matplotlib.pyplot as plt
import pytest


@pytest.fixture(autouse=True)
def closed_figures():
    yield
    plt.close("all")
