"""Pictures of pages in both modes of the site: beside NAME.svg, NAME_dark.svg where there is one."""

from pathlib import Path

from docutils import nodes


def in_both_modes(app, doctree):
    """Add the dark twin of each picture that has one; the theme shows the one of the reader's mode."""
    folder = Path(doctree["source"]).parent
    for picture in list(doctree.findall(nodes.image)):
        path = Path(picture["uri"])
        dark = path.with_stem(f"{path.stem}_dark")
        if not (folder / dark).is_file():
            continue
        twin = picture.deepcopy()
        twin["uri"] = dark.as_posix()
        picture["classes"].append("only-light")
        twin["classes"].append("only-dark")
        picture.parent.insert(picture.parent.index(picture) + 1, twin)
