"""What the scripts of the first pages print and draw: figures of docs/index.md and docs/getting_started.md.

A test compares what the pages say that is printed with what is printed.
"""

import contextlib
import re
import tempfile
from functools import partial

import matplotlib.pyplot as plt
from drawing import DOCS, save

import skmpm


def last_picture(page):
    """The scene and the last state of the script of a page."""
    (code,) = re.findall(r"^```python\n(.*?)^```", (DOCS / page).read_text(), re.DOTALL | re.MULTILINE)
    names = {}
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        exec(code, names)
    plt.close("all")
    return names["scene"], names["state"]


def drawn(scene, state, size, ink):
    """What the scripts draw, with walls that are seen in both modes."""
    figure, axes = plt.subplots(figsize=size, layout="constrained")
    skmpm.plot(scene, state, forces=True, axes=axes)
    for drawn_at, colour in ((3.0, ink.text), (0.5, ink.faint)):  # lines of walls, and the strips behind them
        for each in axes.collections:
            if each.get_zorder() == drawn_at:
                each.set(edgecolor=colour, facecolor=colour)
    return figure


if __name__ == "__main__":
    for name, size in (("index", (4.6, 3.5)), ("getting_started", (3.2, 3.8))):
        save(name, partial(drawn, *last_picture(f"{name}.md"), size), kind="webp")
