"""Sphinx builds the site from this folder: `make docs` all of it, `make docs-quick` without notebooks and gallery."""

import logging
import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path

DOCS = Path(__file__).parent
ROOT = DOCS.parent
sys.path.insert(0, str(DOCS / "_ext"))

_project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
_quick = tags.has("quick")  # type: ignore[name-defined]  # noqa: F821  Sphinx defines it

project = "truespring"
author = "The truespring developers"
copyright = "2026, the truespring developers"
version = release = _project["version"]

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_gallery.gen_gallery",
    "sphinx_design",
    "sphinx_copybutton",
    "docstrings",
    "generated",
    "notebooks",
    "placeholders",
]
exclude_patterns = [
    "_build",
    "**.ipynb_checkpoints",
    *(f"gallery/**/*.{end}" for end in ("ipynb", "json", "py", "zip")),
]
nitpicky = True
# Types in signatures have no page of their own, but those that are public names.
nitpick_ignore_regex = [("py:.*", ".*")]

# Pages: MyST. Notebooks are text with a jupytext header; they run in the whole build only.
myst_enable_extensions = ["amsmath", "attrs_inline", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4
nb_execution_mode = "off" if _quick else "cache"
nb_execution_cache_path = str(ROOT / "out" / "notebooks")
nb_execution_in_temp = True  # notebooks write files
nb_execution_timeout = 600
nb_execution_raise_on_error = not _quick
nb_execution_show_tb = True
nb_merge_streams = True

# API: from the docstrings, which are in Google style and plain text.
autodoc_typehints = "signature"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True}  # a field is described in the list of its class
autoclass_content = "class"
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False
default_role = "code"
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 88

# Films are written by Pillow where ffmpeg is not installed.
logging.getLogger("matplotlib.animation").setLevel(logging.ERROR)
sphinx_gallery_conf = {
    "examples_dirs": str(ROOT / "examples" / "gallery"),
    "gallery_dirs": "gallery",
    "subsection_order": [
        f"../examples/gallery/{section}" for section in ("loads", "stability", "contact", "motion", "accuracy")
    ],
    "filename_pattern": r"\.py$",
    "copyfile_regex": r".*\.(frd|inp|msh)",
    "capture_repr": (),
    "matplotlib_animations": (True, "jshtml"),
    "plot_gallery": not _quick,
    "download_all_examples": False,
    "remove_config_comments": True,
    "show_memory": False,
    "within_subsection_order": "FileNameSortKey",
    "min_reported_time": 1e9,
    "image_scrapers": ("matplotlib",),
    "abort_on_example_error": False,
    "only_warn_on_example_error": True,
}

smartquotes = False  # options such as --quiet and strings are code
html_theme = "pydata_sphinx_theme"
html_title = f"truespring {release}"
# MathJax beside the pages: formulas need no network. The extension of this package is not safe in parallel builds.
_mathjax = find_spec("sphinx-mathjax-offline")
assert _mathjax is not None and _mathjax.origin is not None
html_static_path = ["_static", str(Path(_mathjax.origin).parent / "static")]
mathjax_path = "mathjax/tex-chtml.js"
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = True
html_theme_options = {
    "navbar_align": "left",
    "header_links_before_dropdown": 7,
    "logo": {"text": f"truespring {release}"},
    "navbar_end": ["theme-switcher"],
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "show_prev_next": True,
    "footer_start": ["copyright"],
    "footer_end": ["sphinx-version"],
}
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True
copybutton_exclude = ".linenos, .gp, .go, .c1"
suppress_warnings = ["config.cache"]
