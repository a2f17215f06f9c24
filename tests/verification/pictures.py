"""A canvas of two panels, and PNG files of few colours."""

import numpy as np


def canvas(panels=2):
    """A figure of 7 x 3.6 inches and its panels."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    return plt.subplots(1, panels, figsize=(7.2, 3.7), layout="constrained")


def ticks(panel, values, text):
    """Mark these places, and no others, on a logarithmic x axis."""
    panel.set_xticks(np.asarray(values, dtype=float), text)
    panel.set_xticks([], minor=True)


def keep(figure, file):
    """Write at 120 dpi with 64 colours, and close."""
    import matplotlib.pyplot as plt
    from PIL import Image

    figure.savefig(file, dpi=120)
    plt.close(figure)
    with Image.open(file) as image:
        small = image.convert("RGB").quantize(64)
    small.save(file, optimize=True)
