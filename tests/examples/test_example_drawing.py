"""The helper that saves the pictures of the examples."""

import matplotlib.pyplot as plt
import numpy as np
from PIL import Image

from examples import drawing


def test_pictures_are_written_to_new_directories_and_closed(tmp_path):
    figure, _ = plt.subplots()
    drawing.save(figure, tmp_path / "new" / "picture.png")
    assert (tmp_path / "new" / "picture.png").exists() and figure.number not in plt.get_fignums()


def test_a_wide_view_leaves_no_white_margin(tmp_path):
    """Axes of equal scales are lower than their figure; the picture ends where they do."""
    figure, axes = plt.subplots(figsize=(5, 5))
    axes.set(xlim=(0, 4), ylim=(0, 1), aspect="equal")
    drawing.save(figure, tmp_path / "wide.png")
    drawn = np.asarray(Image.open(tmp_path / "wide.png").convert("L")) < 250
    for lines in (drawn.any(axis=1), drawn.any(axis=0)):
        assert 0 < np.argmax(lines) < 6 and 0 < np.argmax(lines[::-1]) < 6  # [pixels]
    assert drawn.shape[0] < 0.4 * drawn.shape[1]
