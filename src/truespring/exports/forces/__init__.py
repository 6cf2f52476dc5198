"""Energy and forces of exported springs from the arrays of springs.npz: a module that needs only NumPy.

Exports to Python programs write it beside their scripts as spring_forces.py, see `spring_forces`.
"""

import re
from importlib.resources import files

#: The name of the module beside a script.
NAME = "spring_forces.py"

_PARTS = ("laws.py", "elements.py", "body.py")
_IMPORT = re.compile(r"^(from|import) .*?(\([^)]*\))?$\n", re.MULTILINE)


def spring_forces() -> str:
    """Return the source of a module that needs only NumPy, with the classes Body, Springs, Elements and others.

    It consists of the files of this package, without the imports of each other.
    """
    texts = {name: (files("truespring.exports.forces") / name).read_text(encoding="utf-8") for name in _PARTS}
    imports = sorted({found[0] for text in texts.values() for found in _IMPORT.finditer(text)})
    standard = "".join(one for one in imports if "truespring" not in one and "numpy" not in one)
    bodies = []
    for text in texts.values():
        start = text.index('"""', 3) + 3
        bodies.append(_IMPORT.sub("", text[start:]).strip("\n"))
    head = texts["body.py"][: texts["body.py"].index('"""', 3) + 3]
    return f"{head}\n\n{standard}\nimport numpy as np\n\n" + "\n\n\n".join(bodies) + "\n"
