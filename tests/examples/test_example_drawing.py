"""The helper that draws the examples."""

import matplotlib.pyplot as plt
import numpy as np

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
    assert not plt.get_fignums()
