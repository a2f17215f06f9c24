"""How the site runs the examples: the arguments of each script."""

from pathlib import Path
from tempfile import mkdtemp

OUT = Path(mkdtemp(prefix="skmpm_gallery_"))
SHORT = {"compaction": ["--discs", "30", "--until", "0.8"], "rest": ["--discs", "30"]}  # what would take minutes


def arguments(gallery_conf, script_vars):
    """Arguments of an example, which are none of a tutorial."""
    script = Path(script_vars["src_file"])
    if script.parent.name == "tutorials":
        return []
    return ["--out", str(OUT / script.stem), *SHORT.get(script.stem, [])]
