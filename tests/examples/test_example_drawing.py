"""The helper that draws the examples."""

import matplotlib.pyplot as plt
import numpy as np
from PIL import Image

import skmpm
from examples import drawing


def test_fields_end_at_outlines_and_views_are_those_of_the_bodies(tmp_path):
    """A coloured field ends at the outline; a wall that is endless does not widen the view."""
    gel = skmpm.NeoHookean(E=1e6, nu=0.3, density=1e3)
    body = skmpm.Body(skmpm.disc((0.0, 0.0), 1.0, spacing=0.2), gel)
    scene = skmpm.Scene([body], cell=0.25, walls=[skmpm.Wall((0.0, -1.0), (0.0, 1.0))])
    axes = drawing.plot(scene, skmpm.initial(scene), np.ones(body.points.volume.size))
    assert np.allclose([*axes.get_xlim(), *axes.get_ylim()], [-1.1, 1.1, -1.1, 1.1], atol=0.02)
    (field,) = axes.collections
    outline = field.get_clip_path().get_fully_transformed_path()
    assert not outline.contains_point(axes.transData.transform((0.8, 0.8)))
    assert outline.contains_point(axes.transData.transform((0.5, 0.5)))
    drawing.save(axes.figure, tmp_path / "new" / "picture.png")
    assert (tmp_path / "new" / "picture.png").exists()
    assert axes.figure.number not in plt.get_fignums()


def test_a_wide_view_leaves_no_white_margin(tmp_path):
    """Axes of equal scales are lower than their figure; the picture ends where they do."""
    figure, axes = plt.subplots(figsize=(5, 5))
    axes.set(xlim=(0, 4), ylim=(0, 1), aspect="equal")
    drawing.save(figure, tmp_path / "wide.png")
    drawn = np.asarray(Image.open(tmp_path / "wide.png").convert("L")) < 250
    for lines in (drawn.any(axis=1), drawn.any(axis=0)):
        assert 0 < np.argmax(lines) < 6 and 0 < np.argmax(lines[::-1]) < 6  # [pixels]
    assert drawn.shape[0] < 0.4 * drawn.shape[1]
