"""Measure what the tests catch: change one operator or number of the source at a time and run the tests of that line.

1. `python -m benchmarks.mutants sample COUNT SEED` draws mutants from the operators of cosmic-ray, which it needs, and
   writes them to `benchmarks/mutants.json`.
2. `python -m benchmarks.mutants map` runs each test file once under pytest-cov: which test executes which line, and how
   long it takes, is kept in `benchmarks/.cache/mutants/`. Files mapped before are left out.
3. `python -m benchmarks.mutants run` applies each mutant without an outcome to a copy of the repository and runs the
   tests that execute its line, the fastest first, until one fails. `run survived` runs those with that outcome again,
   `run caught 0.2` a random fifth of the caught ones, each by the test that caught it first.
4. `python -m benchmarks.mutants count` prints the share that is caught.

Sites are drawn uniformly from all places where an operator applies, then one mutant at each. Left out are annotations,
docstrings and texts (also the expressions in f-strings), `__repr__`, `__str__`, decorators, and replacements that no
test can miss or none can catch: bit operators for arithmetic ones, identity for equality. Compiled loops (`kernels/`)
and the drawing of maps (`validity/figures.py`: widths, sizes, colours) are not in the scope.

An outcome is "caught" (`by` names the test), "hung" (the tests did not end within three times their time and 20 s),
"survived" or "equivalent", then with the `reason`. A mutant is identified by its function and the text of its line, so
that it is found again after a file was moved. A mutant whose line was changed is `gone`: it keeps its outcome.
The list is a record of one sample; `sample` overwrites it.
"""

import ast
import json
import os
import random
import re
import resource
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Iterator
from importlib.metadata import version
from itertools import chain
from pathlib import Path
from typing import Any, NoReturn

_ROOT = Path(__file__).parents[1]
_LIST = Path(__file__).with_name("mutants.json")
_CACHE = Path(__file__).parent / ".cache" / "mutants"
_SCOPE = ["comparison.py", "support_errors.py", "equilibrium.py", "solution.py", "soundness.py"]
_SCOPE += ["report/verdict/*.py", "solvers/**/*.py", "models/**/*.py"]
_SCOPE += ["validity/**/*.py", "calibration/**/*.py", "loading/**/*.py"]

# Tests of one mutant take this long at most, in seconds as measured under coverage; longer ones are left out.
_BUDGET = 60.0
# A mutant hangs where its tests take this many seconds, and this many times theirs, without an end.
_PATIENCE, _TIMES = 20.0, 3.0

_ARITHMETIC = ("Add", "Sub", "Mul", "Div", "Pow")
_SETS = ("BitOr", "BitAnd")
_ORDER = ("Lt", "LtE", "Gt", "GtE")
_OTHERS = ("AddNot", "ReplaceTrueWithFalse", "ReplaceFalseWithTrue", "ReplaceAndWithOr", "ReplaceOrWithAnd")
_OTHERS += ("ReplaceBreakWithContinue", "ReplaceContinueWithBreak", "NumberReplacer", "ZeroIterationForLoop")
_OTHERS += ("ExceptionReplacer",)


# --- drawing -------------------------------------------------------------------------------------


def _operators() -> Iterator[str]:
    """Yield the names of the operators of cosmic-ray that are drawn from."""
    for group in (_ARITHMETIC, _SETS):
        yield from (f"ReplaceBinaryOperator_{a}_{b}" for a in group for b in group if a != b)
    yield from (f"ReplaceBinaryOperator_{a}_{b}" for a, b in (("FloorDiv", "Div"), ("Mod", "FloorDiv")))
    for group in (_ORDER, ("Eq", "NotEq"), ("Is", "IsNot")):
        yield from (f"ReplaceComparisonOperator_{a}_{b}" for a in group for b in group if a != b)
    yield from (f"ReplaceUnaryOperator_Delete_{a}" for a in ("USub", "Invert", "Not"))
    yield from _OTHERS


def sample(count: int, seed: int) -> None:
    """Draw mutants and write them to the list, without outcomes."""
    import cosmic_ray.plugins
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.mutating import mutate_code

    operators = {name: cosmic_ray.plugins.get_operator(f"core/{name}")() for name in _operators()}
    sites: dict[tuple[str, Any, Any], list[tuple[str, int]]] = {}
    texts = {file: (_ROOT / file).read_text(encoding="utf-8") for file in _files()}
    for file, text in texts.items():
        skipped = _skipped(text)
        seen: Counter[str] = Counter()
        for node in ast_nodes(get_ast(text)):
            for name, operator in operators.items():
                for start, end in operator.mutation_positions(node):
                    if not any(first <= start < last for first, last in skipped):
                        sites.setdefault((file, start, end), []).append((name, seen[name]))
                    seen[name] += 1
    drawn = random.Random(seed)
    order = sorted(sites)
    drawn.shuffle(order)
    mutants: list[dict[str, Any]] = []
    for file, start, end in order:
        name, occurrence = drawn.choice(sites[file, start, end])
        mutated = mutate_code(texts[file], operators[name], occurrence)
        found = _difference(texts[file], mutated or texts[file])
        if found is None or found in [(one["before"], one["after"]) for one in mutants]:
            continue
        mutants.append(
            {"file": file, "function": _function(texts[file], start[0]), "line": start[0], "operator": name}
            | {"before": found[0], "after": found[1], "outcome": None}
        )
        if len(mutants) == count:
            break
    mutants.sort(key=lambda one: (one["file"], one["line"]))
    head = {"seed": seed, "sites": len(sites), "versions": {"cosmic-ray": version("cosmic-ray")}}
    _write({**head, "scope": _SCOPE, "mutants": mutants})


def _files() -> list[str]:
    house = _ROOT / "src" / "truespring"
    found = chain.from_iterable(house.glob(pattern) for pattern in _SCOPE)
    return sorted({file.relative_to(_ROOT).as_posix() for file in found if file.name != "figures.py"})


def _skipped(text: str) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Return start and end, each as line and column, of what is not mutated."""
    found: list[ast.AST] = []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef):
            found += [node.returns] if node.returns else []
            found += node.decorator_list
            found += [node] if node.name in ("__repr__", "__str__") else []
        elif isinstance(node, ast.ClassDef):
            found += node.decorator_list
        elif isinstance(node, ast.arg | ast.AnnAssign) and node.annotation:
            found.append(node.annotation)
        elif isinstance(node, ast.JoinedStr):
            found.append(node)
        elif isinstance(node, ast.Assign) and isinstance(node.value, ast.Subscript):  # an alias of types
            found += [node] if getattr(node.value.value, "id", "") in ("Callable", "Literal") else []
    return [((one.lineno, one.col_offset), (one.end_lineno, one.end_col_offset)) for one in found]  # type: ignore[attr-defined]


def _difference(text: str, mutated: str) -> tuple[str, str] | None:
    """Return the lines that differ, before and after; None where nothing does, or Python does not read the mutant."""
    try:
        if ast.dump(ast.parse(text)) == ast.dump(ast.parse(mutated)):
            return None
    except SyntaxError:
        return None
    before, after = text.split("\n"), mutated.split("\n")
    first = next(i for i, (a, b) in enumerate(zip(before, after, strict=False)) if a != b)
    last = next(i for i, (a, b) in enumerate(zip(before[::-1], after[::-1], strict=False)) if a != b)
    return "\n".join(before[first : len(before) - last]), "\n".join(after[first : len(after) - last])


def _function(text: str, line: int) -> str:
    """Return the dotted name of the innermost function or class around a line, empty at the top of a module."""
    names: list[str] = []
    body: list[ast.stmt] = ast.parse(text).body
    while True:
        around = [one for one in body if isinstance(one, ast.FunctionDef | ast.ClassDef)]
        inner = next((one for one in around if one.lineno <= line <= (one.end_lineno or 0)), None)
        if inner is None:
            return ".".join(names)
        names.append(inner.name)
        body = inner.body


# --- which test executes which line --------------------------------------------------------------


def map_tests() -> None:
    """Run each test file once under coverage, with a context for each test, and keep the data."""
    _CACHE.mkdir(parents=True, exist_ok=True)
    settings = _CACHE / "settings"
    settings.write_text("[run]\nsource = truespring\n", encoding="utf-8")
    for file in sorted((_ROOT / "tests").glob("test_*.py")):
        kept = _CACHE / f"{file.stem}.cov"
        if kept.exists():
            continue
        command = [*_PYTEST, "-m", "not verification", str(file), "--cov=truespring", f"--cov-config={settings}"]
        command += ["--cov-context=test", "--cov-report=", f"--junitxml={kept.with_suffix('.xml')}"]
        subprocess.run(command, cwd=_ROOT, env={**os.environ, "COVERAGE_FILE": str(kept)}, check=False)


_PYTEST = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]


def _seconds() -> dict[str, float]:
    """Return how long each mapped test takes [s]."""
    found = {}
    for file in _CACHE.glob("*.xml"):
        for case in ElementTree.parse(file).iter("testcase"):
            if not len(case):  # neither skipped nor failed
                found[f"tests/{file.stem}.py::{case.get('name')}"] = float(case.get("time", 0))
    return found


def _executing() -> dict[str, dict[int, set[str]]]:
    """Return the tests that execute each line of each file."""
    from coverage.numbits import numbits_to_nums

    found: dict[str, dict[int, set[str]]] = {}
    for file in _CACHE.glob("*.cov"):
        with sqlite3.connect(file) as base:
            query = "select path, context, numbits from line_bits join file on file.id = file_id"
            for path, context, bits in base.execute(f"{query} join context on context.id = context_id"):
                if not context:
                    continue
                lines = found.setdefault("src/" + path.partition("/src/")[2], {})
                for line in numbits_to_nums(bits):
                    lines.setdefault(line, set()).add(context.partition("|")[0])
    return found


def _tests(mutant: dict[str, Any], executing: dict[str, dict[int, set[str]]], seconds: dict[str, float]) -> list[str]:
    """Return the tests that execute a mutant's line, the fastest first, as many as the budget allows.

    Of what is executed as a module is loaded those that execute a line with its name.
    """
    chosen = {test for file, line in _places_of(mutant) for test in executing.get(file, {}).get(line, ())}
    found, spent = [], 0.0
    for test in sorted(chosen & seconds.keys(), key=lambda test: seconds[test]):
        spent += seconds[test]
        if spent > _BUDGET and found:
            break
        found.append(test)
    return found


def _places_of(mutant: dict[str, Any]) -> Iterator[tuple[str, int]]:
    """Yield file and line of a mutant, and of what uses the names that are assigned there outside of functions."""
    texts = {
        file.relative_to(_ROOT).as_posix(): file.read_text(encoding="utf-8")
        for file in sorted((_ROOT / "src").glob("**/*.py"))
    }
    todo, done = [(mutant["file"], mutant["line"])], set()
    while todo:
        file, line = todo.pop()
        done.add((file, line))
        yield file, line
        for name in _assigned(texts[file], line):
            used = re.compile(rf"\b{name}\b")
            known = {file} if name.startswith("_") else {one for one, text in texts.items() if name in text}
            for other in sorted(known):
                lines = [place for place, words in enumerate(texts[other].split("\n"), 1) if used.search(words)]
                todo += [(other, place) for place in lines if (other, place) not in done]


def _assigned(text: str, line: int) -> list[str]:
    """Return the names that a line outside of functions assigns."""
    body: list[ast.stmt] = ast.parse(text).body
    while True:
        around = next((one for one in body if one.lineno <= line <= (one.end_lineno or 0)), None)
        if not isinstance(around, ast.ClassDef):
            break
        body = around.body
    if not isinstance(around, ast.Assign | ast.AnnAssign):
        return []
    targets = around.targets if isinstance(around, ast.Assign) else [around.target]
    return [one.id for target in targets for one in ast.walk(target) if isinstance(one, ast.Name)]


# --- running -------------------------------------------------------------------------------------


def run(outcome: str | None, share: float) -> None:
    """Run the mutants of an outcome, or a random share of them, and write the list after each."""
    kept = json.loads(_LIST.read_text(encoding="utf-8"))
    seconds, executing = _seconds(), _executing()
    chosen = [one for one in kept["mutants"] if one["outcome"] == outcome]
    chosen = random.Random(kept["seed"]).sample(chosen, round(share * len(chosen)))
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "copy"
        # Copied with their times, for which compiled loops are kept.
        shutil.copytree(_ROOT, copy, ignore=shutil.ignore_patterns(".*", "out"))
        _warm(copy)
        there = _collected()
        for one in chosen:
            applied = _applied(copy, one)
            if applied is None:
                one["gone"] = True
                _say(f"{one['file']}:{one['line']}: this line is gone, {one['outcome']} as before")
                continue
            tests = [test for test in _tests(one, executing, seconds) if test in there]
            if one.get("by"):  # by its function where its parameters are worded otherwise now
                function = one["by"].partition("[")[0]
                same = {one["by"]} & there or {test for test in there if test.partition("[")[0] == function}
                tests = [*sorted(same), *(test for test in tests if test not in same)]
            if not tests:
                _say(f"{one['file']}:{one['line']}: no test is mapped to this line, {one['outcome']} as before")
                continue
            began = time.monotonic()
            one["outcome"], one["by"] = _outcome(*applied, tests, sum(seconds.get(test, 1.0) for test in tests))
            spent = time.monotonic() - began
            _say(f"{one['outcome']:9} {one['file']}:{one['line']} by {one['by']} of {len(tests)} in {spent:.0f} s")
            kept["versions"] |= {name: version(name) for name in ("pytest", "truespring")}
            _write(kept)


def _collected() -> set[str]:
    """Return the names of all tests of the copy."""
    command = [*_PYTEST, "--collect-only", "tests"]
    surroundings = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path[:2])}
    listed = subprocess.run(command, env=surroundings, capture_output=True, text=True, check=False)
    return {line for line in listed.stdout.splitlines() if line.startswith("tests/")}


def _warm(copy: Path) -> None:
    """Load once, before processes are forked, what all tests need and no mutant changes: libraries and kernels."""
    import matplotlib.figure  # noqa: F401
    import scipy.interpolate
    import scipy.optimize  # noqa: F401
    import skfem  # noqa: F401

    os.chdir(copy)
    sys.path[:0] = [str(copy / "src"), str(copy)]
    sys.dont_write_bytecode = True
    import truespring as ts

    sides = {"supports": [ts.Fixed("left")], "loads": [ts.Force("right", (1.0, 0.0))]}
    problem = ts.Problem(ts.rectangle((1.0, 1.0), (2, 2)), ts.Material(1e3, 0.3), ts.PlaneStress(1.0), **sides)
    for model in (ts.Springs("lloyd"), ts.Fem("neo-hookean")):
        ts.solve(problem, model, ts.Newton(linear="scipy"))  # threads of other libraries do not outlive a fork
    for name in [name for name in sys.modules if name.partition(".")[0] == "truespring"]:
        if not name.startswith("truespring.kernels"):
            del sys.modules[name]


def _outcome(file: Path, text: str, tests: list[str], seconds: float) -> tuple[str, str | None]:
    """Return the outcome of tests with a mutated file, and the test that catches it."""
    if not tests:
        return "survived", None
    old, before = file.stat(), file.read_text(encoding="utf-8")
    said = Path(tempfile.gettempdir()) / f"mutants-{os.getpid()}"
    file.write_text(text, encoding="utf-8")
    try:
        child = os.fork()
        if not child:
            _test(tests, said, round(_PATIENCE + _TIMES * seconds))
        status = os.waitpid(child, 0)[1]
    finally:
        file.write_text(before, encoding="utf-8")
        os.utime(file, ns=(old.st_atime_ns, old.st_mtime_ns))
    lines = said.read_text(encoding="utf-8", errors="replace").splitlines()
    said.unlink()
    if os.WIFSIGNALED(status) and os.WTERMSIG(status) in (signal.SIGXCPU, signal.SIGALRM, signal.SIGKILL):
        return "hung", None
    if os.WIFEXITED(status) and os.WEXITSTATUS(status) == 0:
        return "survived", None
    by = [line.split(" - ")[0].split(" ", 1)[1] for line in lines if line.startswith(("FAILED ", "ERROR "))]
    return "caught", by[0] if by else "crash"


def _test(tests: list[str], said: Path, seconds: int) -> NoReturn:
    """Run tests in this process until one fails, and end it; it is killed if they take too long."""
    import pytest

    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))
    signal.alarm(20 * seconds)  # for one that waits and does not work
    with said.open("w", encoding="utf-8") as output:
        os.dup2(output.fileno(), 1)
        os.dup2(output.fileno(), 2)
        code = pytest.main(["-x", "-q", "-p", "no:cacheprovider", "--no-header", "-rfE", "--tb=no", *tests])
        output.flush()
    sys.stdout.flush()
    os._exit(int(code))


def _applied(root: Path, mutant: dict[str, Any]) -> tuple[Path, str] | None:
    """Return the file that holds a mutant's line now, and its mutated text; None where the line is gone.

    The line is looked for in its function, in whichever file that is now, else as the only such line of all.
    """
    found: list[tuple[bool, Path, int, str]] = []
    for file in [root / mutant["file"], *sorted((root / "src").glob("**/*.py"))]:
        text = file.read_text(encoding="utf-8") if file.exists() else ""
        for at in _places("\n" + text, f"\n{mutant['before']}\n"):
            line = text.count("\n", 0, at) + 1
            found.append((_function(text, line) == mutant["function"], file, line, text))
    within = [one for one in found if one[0] and one[1] == next(other[1] for other in found if other[0])]
    alone = {one[1:3] for one in found}
    if not within and len(alone) != 1:
        return None
    _, file, line, text = min(within or found, key=lambda one: abs(one[2] - mutant["line"]))
    mutant["file"], mutant["line"] = file.relative_to(root).as_posix(), line
    mutant["function"] = _function(text, line)
    lines = text.split("\n")
    lines[line - 1 : line + mutant["before"].count("\n")] = mutant["after"].split("\n")
    return file, "\n".join(lines)


def _places(text: str, part: str) -> Iterator[int]:
    """Yield where a part of a text begins."""
    at = text.find(part)
    while at >= 0:
        yield at
        at = text.find(part, at + 1)


def count() -> None:
    """Print how many mutants have which outcome, and the share that is caught of those that are not equivalent."""
    mutants = json.loads(_LIST.read_text(encoding="utf-8"))["mutants"]
    found = Counter(one["outcome"] for one in mutants)
    caught = found["caught"] + found["hung"]
    _say(f"{dict(found)}; caught: {caught / max(len(mutants) - found['equivalent'], 1):.1%}")


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def _write(kept: dict[str, Any]) -> None:
    _LIST.write_text(json.dumps(kept, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["sample", number, seed]:
            sample(int(number), int(seed))
        case ["map"]:
            map_tests()
        case ["run", *rest]:
            run(rest[0] if rest else None, float(rest[1]) if rest[1:] else 1.0)
        case ["count"]:
            count()
        case _:
            raise SystemExit(__doc__)
