"""The same study on finer and finer meshes, until what is watched settles."""

import csv
import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from pathlib import Path

import numpy as np

from truespring.comparison import most_moved
from truespring.equilibrium import Path as Equilibria
from truespring.errors import StudyError
from truespring.mesh import nearest_node
from truespring.mesh.selections import AXES
from truespring.settling import Settling, beside, settle
from truespring.study.read import Entry, Study, read_study
from truespring.study.run import follow


def converge(
    study: Study | str | Path,
    tolerance: float = 0.01,
    most: int = 5,
    report: Callable[[Study, str], None] | None = None,
) -> Iterator[list[Settling]]:
    """Solve a study on meshes of half the size each time; yield after each what all models tell.

    It ends when every quantity of every model has settled to `tolerance`, or after `most` meshes. Watched are the
    probe's displacement along each axis, the stored energy, and the reaction where motion drives the body. Raises
    StudyError where the mesh cannot be refined.
    """
    given = study if isinstance(study, Study) else read_study(study)
    nodes: list[int] = []
    values: dict[tuple[str, str, str], list[float]] = {}
    place = None
    for halvings in range(most):
        study = given.finer(halvings) if halvings else given
        nodes.append(study.problem.mesh.n_nodes)
        models = {name: entry for name, entry in study.entries.items() if not isinstance(entry, Equilibria)}
        if not models:
            raise StudyError(f"{study.file}: models: there is none to solve: what was read from files has one mesh")
        mesh = study.problem.mesh
        for name, path in _solved(study, models, report):
            if place is None:
                place = mesh.nodes[most_moved(path) if study.probe is None else study.probe]
            for quantity, unit, value in _watched(path, nearest_node(mesh, place.tolist())):
                values.setdefault((name, quantity, unit), []).append(value)
        told = [settle(*key, nodes, found, tolerance) for key, found in values.items()]
        yield [beside(one, told) for one in told]
        if all(one.settled for one in told):
            return


def _solved(
    study: Study, models: Mapping[str, Entry], report: Callable[[Study, str], None] | None
) -> Iterator[tuple[str, Equilibria]]:
    for name, model in models.items():
        if report:
            report(study, name)
        path = follow(study, model)
        if not path.complete:
            at = f"stopped at load factor {path.load_factor:.4g} on {study.problem.mesh.n_nodes:,} nodes"
            raise StudyError(f"{study.file}: models.{name}: {at}: {path.status.advice}")
        yield name, path


def _watched(path: Equilibria, probe: int) -> Iterator[tuple[str, str, float]]:
    state = path.states[-1]
    for direction, value in zip(AXES, state.displacement[probe], strict=False):
        yield f"u{direction} of the probe", "m", float(value)
    yield "energy", "J", state.energy
    if path.problem.loading.driven_by_motion:
        force = path.applied_force(state)
        axis = int(np.abs(force).argmax())
        yield f"reaction along {AXES[axis]}", "N", float(force[axis])


def write_settling(found: list[Settling], folder: Path) -> None:
    """Write converge.csv, a row a model, quantity and mesh, and converge.json."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "converge.csv").open("w", newline="", encoding="utf-8") as stream:
        table = csv.writer(stream)
        table.writerow(["model", "quantity", "unit", "n_nodes", "value"])
        for one in found:
            for count, value in zip(one.n_nodes, one.values, strict=True):
                table.writerow([one.model, one.quantity, one.unit, count, repr(value)])
    (folder / "converge.json").write_text(json.dumps([asdict(one) for one in found], indent=1) + "\n")
