"""Sphinx configuration; `python -m sphinx -W -n docs docs/_build` runs tutorials and examples and builds the site."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import docstrings
import modules
import pictures
from run_examples import arguments

import skmpm

project, author = "skmpm", "The skmpm developers"
version = release = skmpm.__version__
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.intersphinx",
    "sphinx.ext.viewcode",
    "sphinx-mathjax-offline",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["_build", "templates", "tutorials"]
templates_path = ["templates"]
suppress_warnings = ["config.cache"]  # the gallery's functions
nitpicky = True
# Names of other libraries that their inventories here lack.
nitpick_ignore_regex = [("py:.*", r"(?!skmpm|numpy\.|scipy\.|pandas\.|matplotlib\.|skfem\.|pathlib\.).*")]

default_role = "autolink"
rst_prolog = ".. currentmodule:: skmpm"
autosummary_filename_map = docstrings.filenames()
autosummary_context = {"shown": docstrings.SHOWN}
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_typehints = "none"  # `docstrings` reads them
# What docstrings link to, in texts of lines "name type page" that are extended by hand: a build needs no network.
intersphinx_mapping = {
    name: (url, f"inventories/{name}.inv")
    for name, url in {
        "matplotlib": "https://matplotlib.org/stable/",
        "numpy": "https://numpy.org/doc/stable/",
        "pandas": "https://pandas.pydata.org/docs/",
        "python": "https://docs.python.org/3/",
        "scikit-fem": "https://scikit-fem.readthedocs.io/en/latest/",
        "scipy": "https://docs.scipy.org/doc/scipy/",
    }.items()
}
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3

html_theme = "pydata_sphinx_theme"
html_title = f"skmpm {version}"
html_static_path = ["static"]
html_css_files = ["skmpm.css"]
html_show_sourcelink = False
html_theme_options = {
    "navigation_with_keys": False,
    "show_nav_level": 1,
    "header_links_before_dropdown": 10,
    "navbar_persistent": ["search-button"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "secondary_sidebar_items": ["page-toc"],
}
html_sidebars = {"index": [], "getting_started": [], "limits": []}
copyright = "2026, The skmpm developers"  # noqa: A001

sphinx_gallery_conf = {
    "examples_dirs": ["tutorials", "../examples"],
    "gallery_dirs": ["generated/tutorials", "generated/gallery"],
    "filename_pattern": r"\.py$",
    "ignore_pattern": r"__init__\.py$|/studies/",
    "within_subsection_order": "FileNameSortKey",
    "reset_argv": arguments,
    "copyfile_regex": r"$^",
    "download_all_examples": False,
    "capture_repr": ("_repr_html_",),
    "show_signature": False,
    "remove_config_comments": True,
    "abort_on_example_error": True,
    "min_reported_time": 1e9,
    "show_memory": False,
    "reference_url": {"skmpm": None},
    "backreferences_dir": "generated/backreferences",
    "doc_module": ("skmpm",),
    "plot_gallery": True,
}


def setup(app):
    """Read docstrings as they are written here, link classes by their public names, write the table of modules."""
    app.connect("builder-inited", lambda app: modules.write())
    app.connect("doctree-read", pictures.in_both_modes, priority=400)  # before images are collected
    app.connect("autodoc-process-docstring", docstrings.described)
    app.connect("autodoc-process-signature", docstrings.signed)
