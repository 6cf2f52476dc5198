"""truespring: mass-spring bodies true to their material, beside FEM.

problem  x  model  x  solver  ->  path of equilibria  ->  comparison  ->  report
"""

import lazy_loader

# The names stand in __init__.pyi, each once, and are imported when they are used: the command line answers at once.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
