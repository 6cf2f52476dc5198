"""Running studies: solve what a study asks, compare, and write what it leaves behind."""

import dataclasses
import json
import re
import shlex
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from truespring.comparison import compare, most_moved
from truespring.equilibrium import Path, solve
from truespring.errors import StudyError
from truespring.material import Material, PlaneStrain, PlaneStress, Solid
from truespring.mesh.selections import AXES
from truespring.models import (
    RULES,
    Fem,
    Fitness,
    Heml,
    MassTensor,
    Moduli,
    SpringNetwork,
    Springs,
    follows_poisson,
    judge,
    model_warnings,
    moduli,
)
from truespring.problem import Problem
from truespring.reactions import moved_supports
from truespring.reference import Program
from truespring.report.curves import write_curves, write_reactions
from truespring.report.result import Result
from truespring.report.series import write_mesh, write_series, write_stl
from truespring.report.summary import moduli_values, summary
from truespring.solvers import Reporter
from truespring.study.read import Entry, Study, read_study
from truespring.study.standings import standings

#: Called with study, model and the load factor reached, for a progress bar.
Progress = Callable[[str, str, float], None]


def read_studies(files: Sequence[str | FilePath]) -> list[Study]:
    """Read and check all studies before any is solved; raise StudyError with the faults of all of them."""
    studies: list[Study] = []
    faults: list[str] = []
    seen: dict[str, str | FilePath] = {}
    for file in files:
        stem = FilePath(file).stem.casefold()
        if stem in seen:
            faults.append(f"{file} and {seen[stem]} have one stem, '{stem}': their outputs would share a folder")
        seen[stem] = file
        try:
            studies.append(read_study(file))
        except StudyError as error:
            faults.append(str(error))
    if faults:
        raise StudyError("\n".join(faults))
    return studies


def run(study: Study, progress: Progress | None = None, comparing: bool = True, refining: bool = True) -> Result:
    """Solve every model of a study and, if wanted, compare; a model that fails keeps what it reached.

    With `refining`, unless the study leaves it out, references are refined to tell how far they are themselves off.
    """
    paths: dict[str, Path] = {}
    for name, entry in study.entries.items():

        def report(load_factor: float, iteration: int, residual: float, name: str = name) -> None:
            if progress:
                progress(study.stem, name, load_factor)

        paths[name] = follow(study, entry, report)
        if progress and not isinstance(entry, Path):
            progress(study.stem, name, 1.0)
    model = paths[study.model]
    probe = most_moved(model) if study.probe is None else study.probe
    names = study.references if comparing else ()
    return Result(
        title=study.title,
        file=study.file,
        problem=study.problem,
        paths=paths,
        probe=probe,
        model=study.model,
        comparisons={name: compare(model, paths[name], probe, study.tolerance) for name in names},
        tolerance=study.tolerance,
        source=study.source,
        fitness={
            name: judge(study.problem, entry, study.tolerance)
            for name, entry in study.entries.items()
            if isinstance(entry, Springs)
        }
        if comparing
        else {},
        standings=standings(study, paths, names) if refining else {},
    )


def follow(study: Study, entry: Entry, report: Reporter | None = None) -> Path:
    """Return the path of an entry of a study: solved here, solved by another program, or as it was read."""
    if isinstance(entry, Path):
        return entry
    if isinstance(entry, Program):
        return entry.run(study.problem, study.solver, report)
    return solve(study.problem, entry, study.solver, report)


@dataclass(frozen=True, eq=False)
class Realised:
    """What the springs of a model realise, known without solving.

    Attributes:
        name: of the model in the study.
        springs: the model.
        by_material: the moduli beside each material, that of the body first, then those of its regions.
        fitness: whether the springs are fit for all of them, and which are better.
    """

    name: str
    springs: Springs
    by_material: tuple[tuple[Material, Moduli], ...]
    fitness: Fitness

    @property
    def titles(self) -> tuple[str, ...]:
        """What the moduli beside each material are called: by the material where there are several."""
        what = f"what '{self.name}' realises, {self.springs.label}"
        if len(self.by_material) == 1:
            return (what,)
        return tuple(
            f"{what}, where E is {material.young:g} Pa and Poisson's ratio {material.poisson:g}"
            for material, _ in self.by_material
        )


def realised_moduli(study: Study) -> Iterator[Realised]:
    """Yield what each springs model of a study realises, solving nothing."""
    for name, entry in study.entries.items():
        if isinstance(entry, Springs):
            found = []
            for twin in study.problem.homogeneous:
                assert twin.material is not None  # a study has one
                found.append((twin.material, moduli(twin, entry)))
            yield Realised(name, entry, tuple(found), judge(study.problem, entry, study.tolerance))


def realised_values(realised: Realised) -> dict[str, Any]:
    """Return what springs realise as values that JSON can hold: of the body's own material, then of its regions'."""
    (material, first), *others = realised.by_material
    fitness, better = realised.fitness, realised.fitness.better
    return {
        "label": realised.springs.label,
        "material": _material(material),
        **moduli_values(first),
        **(
            {"regions": [{"material": _material(one), **moduli_values(found)} for one, found in others]}
            if others
            else {}
        ),
        "fit": fitness.fit,
        "reasons": list(fitness.reasons),
        "better": None if better is None else {"rule": better.rule, "volume": better.volume},
        "sentence": fitness.sentence,
    }


def _material(material: Material) -> dict[str, float]:
    return {"young": material.young, "poisson": material.poisson}


def write_moduli(study: Study, realised: Sequence[Realised], out: FilePath) -> FilePath | None:
    """Write moduli.json and a picture of Young's modulus by direction into out/STEM; return the picture, if any."""
    folder = out / study.stem
    folder.mkdir(parents=True, exist_ok=True)
    values = {one.name: realised_values(one) for one in realised}
    (folder / "moduli.json").write_text(json.dumps(values, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    if not realised:
        return None
    from truespring.report.young import save_young

    labels = [one.springs.label for one in realised]
    several = {
        one.springs.label if labels.count(one.springs.label) == 1 else f"{one.springs.label} ({one.name})": moduli
        for one in realised
        for moduli in [one.by_material[0][1]]
    }
    within = " in plane strain" if isinstance(study.problem.section, PlaneStrain) else ""
    return save_young(several, f"material{within}", folder / "figures")


def rule_values() -> dict[str, dict[str, Any]]:
    """Return the stiffness rules with what they realise and their source, as values that JSON can hold."""
    return {
        name: {
            "elements": list(rule.elements),
            "realises": rule.realises,
            "follows_poisson": follows_poisson(name),
            "coupled": rule.coupled,
            "parameters": list(rule.parameters),
            "source": rule.source,
        }
        for name, rule in RULES.items()
    }


def write(result: Result, out: FilePath, report: bool = True) -> None:
    """Write curves, summary, VTU series and STL of a study into out/STEM, with `report` the figures too."""
    folder = out / result.stem
    folder.mkdir(parents=True, exist_ok=True)
    _clear(folder)
    write_curves(result, folder / "curves.csv")
    (folder / "reactions.csv").unlink(missing_ok=True)
    if moved_supports(result.problem):
        write_reactions(result, folder / "reactions.csv")
    text = json.dumps(summary(result), indent=2, allow_nan=False)
    (folder / "summary.json").write_text(text + "\n", encoding="utf-8")
    if result.problem.mesh.element != "line":
        write_mesh(result.problem.mesh, folder / "mesh.vtu", result.problem.loading.held)
    for name, path in result.paths.items():
        write_series(path, folder, name)
        write_stl(path, folder / f"deformed_{name}.stl")
    if report:
        from truespring.report.figures import save_figures
        from truespring.report.page import write_page

        save_figures(result, folder / "figures")
        write_page([result], folder / "report.html", _command([result], out))


def _clear(folder: FilePath) -> None:
    """Remove what a former run of the study left, so that no model of then stands beside those of now."""
    try:
        former = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["models"]
        names = [name for name in former if re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_-]*", name)]
    except (OSError, ValueError, KeyError, TypeError):
        return
    figures = [*_FIGURES, *(f"{one}_{what}_{other}" for one in names for other in names for what in ("over", "error"))]
    left = [folder / "report.html"]
    left += [folder / "figures" / f"{figure}.{kind}" for figure in figures for kind in ("png", "svg")]
    for name in names:
        left += [folder / f"{name}.pvd", folder / f"deformed_{name}.stl", *(folder / name).glob(f"{name}_*.vtu")]
    for file in left:
        file.unlink(missing_ok=True)
    for name in ("figures", *names):
        if (folder / name).is_dir() and not any((folder / name).iterdir()):
            (folder / name).rmdir()


_FIGURES = ("undeformed", "curves", "reactions", "error", "moduli")


def write_overview(results: Sequence[Result], out: FilePath) -> None:
    """Write out/report.html over all studies, each written before; over one alone, its own page once more."""
    if len(results) == 1:
        shutil.copyfile(out / results[0].stem / "report.html", out / "report.html")
        return
    from truespring.report.page import write_page

    write_page(results, out / "report.html", _command(results, out))


def _command(results: Sequence[Result], out: FilePath) -> str:
    return shlex.join(["truespring", "verify", *(str(result.file) for result in results), "--out", str(out)])


def plan(study: Study) -> dict[str, Any]:
    """Return what would be run, solving nothing: sizes, loads, supports, and what the springs realise."""
    problem = study.problem
    mesh, loading = problem.mesh, problem.loading
    return {
        "title": study.title,
        "size": (mesh.upper - mesh.lower).tolist(),
        "n_nodes": mesh.n_nodes,
        "n_elements": len(mesh.elements),
        "mesh_notes": list(mesh.notes),
        "material": dataclasses.asdict(problem.material) if problem.material else None,
        "regions": [
            {**dataclasses.asdict(material), "n_elements": int((problem.material_numbers == number).sum())}
            for number, material in enumerate(problem.materials[1:], start=1)
        ],
        "section": _section(problem),
        "n_unknowns": int((~loading.held).sum()),
        "held": {axis: int(loading.held[:, number].sum()) for number, axis in enumerate(AXES[: mesh.dim])},
        "total_force": loading.force(mesh.nodes).sum(axis=0).tolist(),
        "largest_motion": float(np.linalg.norm(loading.motion(), axis=1).max()),
        "load_steps": getattr(study.solver, "load_steps", None) or getattr(study.solver, "steps", None),
        "models": {name: _entry_plan(study, entry) for name, entry in study.entries.items()},
        "compare": {"model": study.model, "references": list(study.references), "tolerance": study.tolerance},
        "probe": None if study.probe is None else mesh.nodes[study.probe].tolist(),
    }


def _section(problem: Problem) -> dict[str, Any] | None:
    if problem.section is None or isinstance(problem.section, Solid):
        return None
    kind = "plane-stress" if isinstance(problem.section, PlaneStress) else "plane-strain"
    return {"kind": kind, "thickness": problem.section.thickness}


def _entry_plan(study: Study, entry: Any) -> Mapping[str, Any]:
    if isinstance(entry, SpringNetwork):
        return {"kind": "network", "label": "springs", "n_springs": len(entry.springs), "warnings": []}
    if isinstance(entry, Program):
        return {"kind": entry.kind, "label": entry.label_on(study.problem), "warnings": []}
    if not isinstance(entry, Springs):
        known = entry.warnings if isinstance(entry, Path) else model_warnings(study.problem, entry)
        law = {"law": entry.law} if isinstance(entry, Fem | Heml | MassTensor) else {}
        law |= {"element": entry.chosen_element(study.problem)} if isinstance(entry, Fem) else {}
        return {"kind": entry.kind, "label": entry.label, **law, "warnings": list(known)}
    realised = moduli(study.problem.homogeneous[0], entry)
    fitness = judge(study.problem, entry, study.tolerance)
    return {
        "kind": entry.kind,
        "label": entry.label,
        "n_springs": realised.n_springs,
        "moduli": moduli_values(realised),
        "fit": fitness.fit,
        "sentence": fitness.sentence,
        "warnings": list(model_warnings(study.problem, entry)),
    }
