"""How the site runs the examples: the arguments of each script, and the pictures that it writes."""

import shutil
from pathlib import Path
from tempfile import mkdtemp

from sphinx_gallery.scrapers import figure_rst

OUT = Path(mkdtemp(prefix="skmpm_gallery_"))
SHORT = {"compaction": ["--discs", "30", "--until", "0.8"], "rest": ["--discs", "30"]}  # what would take minutes


def arguments(gallery_conf, script_vars):
    """Arguments of an example, which are none of a tutorial."""
    script = Path(script_vars["src_file"])
    if script.parent.name == "tutorials":
        return []
    return ["--out", str(OUT / script.stem), *SHORT.get(script.stem, [])]


class Pictures:
    """The files that an example writes, as the pictures of its page."""

    def __repr__(self):
        return "Pictures"  # part of the configuration, whose changes rebuild everything

    def __call__(self, block, block_vars, gallery_conf):
        """Copy new pictures of the example that runs, and return what shows them."""
        shown = []
        for file in sorted((OUT / Path(block_vars["src_file"]).stem).glob("*.png")):
            place = next(block_vars["image_path_iterator"])
            shutil.move(file, place)
            shown.append(place)
        return figure_rst(shown, gallery_conf["src_dir"])


PICTURES = Pictures()
