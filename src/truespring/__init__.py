"""truespring: mass-spring models that match their material, compared with FEM.

problem  x  model  x  solver  ->  path of equilibria (a Solution)  ->  comparison  ->  report
"""

import logging
import warnings
from typing import Any

import lazy_loader

# The names are listed in __init__.pyi, each once, and imported on first use: the command line starts at once.
_attribute, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

# Messages of the library: silent unless the program that uses it asks for them, see docs/reference/progress.md.
logging.getLogger(__name__).addHandler(logging.NullHandler())

# Names of earlier releases and their successors; removed in the next release.
_RENAMED = {"GivenSprings": "PrescribedSprings", "Path": "Solution"}


def __getattr__(name: str) -> Any:
    if name in _RENAMED:
        successor = _RENAMED[name]
        warnings.warn(f"truespring.{name} is deprecated, use truespring.{successor}", DeprecationWarning, stacklevel=2)
        return _attribute(successor)
    if name == "__version__":
        from importlib.metadata import version

        return version(__name__)
    return _attribute(name)
