"""Running studies: solve what a study asks, compare, and write what it leaves behind."""

import json
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from truespring.comparison import compare, most_moved
from truespring.equilibrium import Solution, solve, unsolved
from truespring.errors import StudyError
from truespring.material import Material
from truespring.mesh.selections import AXES
from truespring.models import (
    RULES,
    Fitness,
    Model,
    Moduli,
    Springs,
    follows_poisson,
    judge,
    moduli,
    springs_by_rule,
)
from truespring.outputs import Output, write_whole
from truespring.potential import Stretched
from truespring.problem import Problem
from truespring.reactions import moved_supports
from truespring.report.curves import write_curves, write_reactions
from truespring.report.result import Result
from truespring.report.series import write_mesh, write_series, write_stl
from truespring.report.summary import moduli_values, summary
from truespring.solvers import Reporter
from truespring.study.read import Study, read_study
from truespring.study.standings import standings

#: Called with study, model and the load factor reached, for a progress bar.
Progress = Callable[[str, str, float], None]

#: Called with the name of a model and its path as soon as that is known.
Known = Callable[[str, Solution], None]


def read_studies(files: Sequence[str | Path]) -> list[Study]:
    """Read and check all studies before any is solved; raise StudyError with the faults of all of them."""
    studies: list[Study] = []
    faults: list[str] = []
    seen: dict[str, str | Path] = {}
    for file in files:
        stem = Path(file).stem.casefold()
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


def run(
    study: Study,
    progress: Progress | None = None,
    comparing: bool = True,
    timeout: float | None = None,
    known: Known | None = None,
    refining: bool = True,
) -> Result:
    """Solve every model of a study and, if wanted, compare; a model that fails keeps what it reached.

    With a `timeout` [s] each model is given up after that long; another program after an hour where none is given.
    `known` is told each path before the next model is solved. With `refining`, unless the study leaves it out,
    references are refined to tell how far they are themselves off.
    """
    paths: dict[str, Solution] = {}
    for name, entry in study.entries.items():

        def report(load_factor: float, iteration: int, residual: float, name: str = name) -> None:
            if progress:
                progress(study.stem, name, load_factor)

        paths[name] = follow(study, entry, report, timeout)
        if progress and entry.solves:
            progress(study.stem, name, 1.0)
        if known:
            known(name, paths[name])
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
            name: judge(study.problem, entry, study.tolerance) for name, entry in springs_by_rule(study.entries).items()
        }
        if comparing
        else {},
        standings=standings(study, paths, names) if refining else {},
    )


def follow(study: Study, model: Model, report: Reporter | None = None, timeout: float | None = None) -> Solution:
    """Return the path of a model of a study: solved here, solved by another program, or as it was read.

    Whatever is raised on the way is this model's own: its path is at rest then, and tells why.
    """
    try:
        return solve(study.problem, model, study.solver, report, timeout)
    except Exception as error:
        return unsolved(study.problem, model, error)


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
    for name, entry in springs_by_rule(study.entries).items():
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


def write_moduli(study: Study, realised: Sequence[Realised], out: Path) -> Path | None:
    """Write moduli.json and a picture of Young's modulus by direction into out/STEM; return the picture, if any."""
    with Output(out / study.stem, "moduli.json") as output:
        values = {one.name: realised_values(one) for one in realised}
        text = json.dumps(values, indent=2, allow_nan=False)
        (output.staging / "moduli.json").write_text(text + "\n", encoding="utf-8")
        picture = _draw_moduli(study, realised, output.staging / "figures") if realised else None
        output.publish()
    return None if picture is None else out / study.stem / "figures" / picture.name


def _draw_moduli(study: Study, realised: Sequence[Realised], folder: Path) -> Path:
    from truespring.report.young import save_young

    labels = [one.springs.label for one in realised]
    several = {
        one.springs.label if labels.count(one.springs.label) == 1 else f"{one.springs.label} ({one.name})": moduli
        for one in realised
        for moduli in [one.by_material[0][1]]
    }
    within = study.problem.section.within if study.problem.section else ""
    return save_young(several, f"material{within}", folder)


def rule_values() -> dict[str, dict[str, Any]]:
    """Return the stiffness rules with what they realise and their source, as values that JSON can hold."""
    return {
        name: {
            "elements": list(rule.elements),
            "idea": rule.idea,
            "realises": rule.realises,
            "shapes": dict(rule.shapes),
            "follows_poisson": follows_poisson(name),
            "coupled": rule.coupled,
            "parameters": list(rule.parameters),
            "source": rule.source,
        }
        for name, rule in RULES.items()
    }


def output(study: Study | Result, out: Path) -> Output:
    """Return the output of a study, in out/STEM."""
    return Output(out / study.stem, "summary.json")


def write(result: Result, out: Path, report: bool = True) -> None:
    """Write curves, summary, VTU series and STL of a study into out/STEM, with `report` the figures and a page too."""
    with output(result, out) as own:
        for name, path in result.paths.items():
            write_model(path, own, name)
        write_rest(result, own, verify_command([result], out) if report else None)


def write_model(path: Solution, output: Output, name: str) -> None:
    """Write what a model alone leaves, its VTU series and STL, as soon as it is solved."""
    write_series(path, output.staging, name)
    write_stl(path, output.staging / f"deformed_{name}.stl")


def write_rest(result: Result, output: Output, command: str | None) -> None:
    """Write what all models leave together and publish it; figures and a page, which tells the `command`, with one."""
    folder = output.staging
    write_curves(result, folder / "curves.csv")
    if moved_supports(result.problem):
        write_reactions(result, folder / "reactions.csv")
    if result.problem.mesh.element != "line":
        write_mesh(result.problem.mesh, folder / "mesh.vtu", result.problem.loading.held)
    if command is not None:
        from truespring.report.figures import save_figures
        from truespring.report.page import write_page

        save_figures(result, folder / "figures")
        write_page([result], folder / "report.html", command)
    text = json.dumps(summary(result), indent=2, allow_nan=False)
    (folder / "summary.json").write_text(text + "\n", encoding="utf-8")
    output.publish()


def write_overview(results: Sequence[Result], out: Path) -> None:
    """Write out/report.html over all studies, each written before; over one alone, its own page once more."""
    from truespring.report.page import render_page

    if len(results) == 1:
        page = (out / results[0].stem / "report.html").read_bytes()
    else:
        page = render_page(results, verify_command(results, out)).encode()
    write_whole(out / "report.html", page)


def verify_command(studies: Sequence[Study | Result], out: Path) -> str:
    """Return the command line that verifies studies."""
    return shlex.join(["truespring", "verify", *(str(study.file) for study in studies), "--out", str(out)])


def _values(material: Material) -> dict[str, float | None]:
    """The keys of `[material]` with their values [SI]."""
    young, poisson, density = material.young, material.poisson, material.density
    return {"young": young, "poisson": poisson, "density": density, **dict(material.constants)}


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
        "material": _values(problem.material) if problem.material else None,
        "regions": [
            {**_values(material), "n_elements": int((problem.material_numbers == number).sum())}
            for number, material in enumerate(problem.materials[1:], start=1)
        ],
        "section": _section(problem),
        "n_unknowns": int((~loading.held).sum()),
        "held": {axis: int(loading.held[:, number].sum()) for number, axis in enumerate(AXES[: mesh.dim])},
        "total_force": loading.force(mesh.nodes).sum(axis=0).tolist(),
        "largest_motion": float(np.linalg.norm(loading.motion(), axis=1).max()),
        "load_steps": study.solver.load_steps,
        "models": {name: _model_plan(study, name) for name in study.entries},
        "compare": {"model": study.model, "references": list(study.references), "tolerance": study.tolerance},
        "probe": None if study.probe is None else mesh.nodes[study.probe].tolist(),
    }


def _section(problem: Problem) -> dict[str, Any] | None:
    if problem.section is None or not problem.section.key:
        return None
    return {"kind": problem.section.key, "thickness": problem.section.thickness}


def _model_plan(study: Study, name: str) -> Mapping[str, Any]:
    """Return what is known of a model before it is solved."""
    problem, model = study.problem, study.entries[name]
    realised = model.moduli(problem.homogeneous[0]) if problem.material is not None else None
    plan: dict[str, Any] = {"kind": study.keys.models[name].kind, "label": model.label_on(problem)}
    plan |= {} if model.law is None else {"law": model.law}
    element = model.chosen_element(problem)
    plan |= {} if element is None else {"element": element}
    if realised is not None:
        plan |= {"n_springs": realised.n_springs, "moduli": moduli_values(realised)}
    elif model.has_springs:
        potential = model.potential(problem)
        plan |= {"n_springs": len(potential.springs)} if isinstance(potential, Stretched) else {}
    for springs in springs_by_rule({name: model}).values():
        fitness = judge(problem, springs, study.tolerance)
        plan |= {"fit": fitness.fit, "sentence": fitness.sentence}
    return plan | {"warnings": list(model.warnings(problem))}
