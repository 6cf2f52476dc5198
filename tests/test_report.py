"""The verdict in words, the figures and the page, on paths whose errors are known by construction."""

import base64
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path as FilePath
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

import truespring as ts
from truespring.mesh import Surface
from truespring.report.figures import draw_figures, over_name, save_figures
from truespring.report.page import render_page, write_page
from truespring.report.plots import _apart
from truespring.report.quantity import given, percent, quantity, significant
from truespring.report.result import Result
from truespring.report.verdict import closest_sentence, drive, force_sentence, moduli_sentence, verdict

LEVELS = (0.2, 0.4, 0.6, 0.8, 1.0)
LABELS = {"linear": "linear FEM", "svk": "St. Venant-Kirchhoff FEM", "hencky": "Hencky FEM"}


def stretched(**supports: Any) -> ts.Problem:
    """A strip of 4 x 1 squares pulled along x, or moved where supports are given."""
    return ts.Problem(
        mesh=ts.rectangle(size=(0.08, 0.02), elements=(4, 1)),
        material=ts.Material(young=10e3, poisson=1 / 3),
        section=ts.PlaneStress(thickness=0.01),
        supports=[ts.Fixed(on="left"), *supports.get("more", ())],
        loads=supports.get("loads", [ts.Force(on="right", total=(0.4, 0.0))]),
    )


def path(
    problem: ts.Problem,
    factors: Sequence[float] = (1,) * 5,
    levels: Sequence[float] = (0.0, *LEVELS),
    **more: Any,
) -> ts.Path:
    """A path that moves every node in proportion to its x, at each loaded level by `factors` times the level."""
    loaded = dict(zip(LEVELS, factors, strict=True))
    nodes = problem.mesh.nodes
    shape = np.column_stack([nodes[:, 0], 0 * nodes[:, 0]])
    states = []
    for level in levels:
        displacement = 0.3 * level * loaded.get(level, 0.0) * shape
        states.append(
            ts.State(
                load_factor=level,
                positions=nodes + displacement,
                displacement=displacement,
                reaction=np.zeros_like(nodes),
                energy=0.0,
                iterations=3,
                residual=1e-12,
                negative_eigenvalues=0,
                branched=False,
                area_ratio=0.9,
                stretch=None,
            )
        )
    values = {"label": "linear FEM", "kind": "fem", "status": ts.Status.CONVERGED, **more}
    return ts.Path(problem=problem, states=tuple(states), **values)


def result(
    model: ts.Path,
    references: Mapping[str, ts.Path],
    title: str = "A strip",
    stem: str = "strip",
    name: str = "springs",
) -> Result:
    probe = ts.named_point(model.problem.mesh, "right-middle")
    return Result(
        title=title,
        file=FilePath(f"{stem}.toml"),
        problem=model.problem,
        paths={name: model, **references},
        probe=probe,
        model=name,
        comparisons={key: ts.compare(model, one, probe, 0.05) for key, one in references.items()},
        tolerance=0.05,
        source='# A strip of\n# soft stuff.\ntitle = "A strip"  # <as written>\n',
    )


def said(errors: Mapping[str, Sequence[float]], **model: Any) -> str:
    """The verdict on springs whose rms error against each reference is given by level."""
    problem = stretched()
    springs = path(problem, label="springs (lloyd)", kind="springs", **model)
    references = {
        key: path(problem, [1 / (1 + error) for error in values], label=LABELS[key]) for key, values in errors.items()
    }
    return verdict(result(springs, references))


@pytest.mark.parametrize(
    ("errors", "text"),
    [
        (
            {"linear": (0.01, 0.01, 0.01, 0.01, 0.021)},
            "Up to full load springs stay within 5 % of linear FEM. At full load: linear FEM 2.1 %.",
        ),
        (
            {"linear": (0.01, 0.02, 0.2, 0.3, 0.34), "svk": (0.03, 0.04, 0.06, 0.1, 0.123)},
            "Up to load factor 0.4 springs stay within 5 % of both references; beyond, at full load: "
            "St. Venant-Kirchhoff FEM 12 %, linear FEM 34 %.",
        ),
        (
            {
                "linear": (0.01, 0.02, 0.2, 0.3, 0.34),
                "svk": (0.01, 0.01, 0.02, 0.02, 0.03),
                "hencky": (0.1, 0.2, 0.5, 0.9, 1.23),
            },
            "Springs stay within 5 % of St. Venant-Kirchhoff FEM up to full load, of linear FEM up to load factor 0.4, "
            "and of Hencky FEM at no load level. At full load: St. Venant-Kirchhoff FEM 3.0 %, linear FEM 34 %, "
            "Hencky FEM 120 %.",
        ),
        (
            {"linear": (0.1, 0.1, 0.2, 0.3, 0.4), "svk": (0.1, 0.1, 0.2, 0.3, 0.3)},
            "At no load level do springs come within 5 % of any reference. At full load: "
            "St. Venant-Kirchhoff FEM 30 %, linear FEM 40 %.",
        ),
        (
            {"linear": (0.1, 0.04, 0.03, 0.3, 0.4), "svk": (0.1, 0.06, 0.04, 0.03, 0.02)},
            "Springs come within 5 % of St. Venant-Kirchhoff FEM only from load factor 0.6 on, and of linear FEM only "
            "between load factors 0.4 and 0.6. At full load: St. Venant-Kirchhoff FEM 2.0 %, linear FEM 40 %.",
        ),
        (
            {"linear": (0.01, 0.1, 0.2, 0.06, 0.04)},
            "Up to load factor 0.2 and again at full load springs stay within 5 % of linear FEM; beyond, at full load: "
            "linear FEM 4.0 %.",
        ),
    ],
    ids=["to full load", "one limit", "two limits", "never", "only later", "gap"],
)
def test_verdict_of_complete_paths(errors: Mapping[str, Sequence[float]], text: str) -> None:
    assert said(errors) == text


def test_trouble_of_the_model_is_said_first() -> None:
    fine = {"linear": (0.01,) * 5}
    stopped = said(fine, levels=(0.0, 0.2, 0.4), status=ts.Status.NOT_CONVERGED)
    assert stopped == (
        "Springs found no equilibrium beyond load factor 0.4. Up to load factor 0.4, the last level that both reached, "
        "springs stay within 5 % of linear FEM. With linear FEM the comparison ends at load factor 0.4, there 1.0 %."
    )
    nowhere = said(fine, levels=(0.0,), status=ts.Status.NOT_CONVERGED)
    assert nowhere == (
        "Springs found no equilibrium at any load level. Linear FEM and springs have no load level in common."
    )


@pytest.mark.parametrize(
    ("status", "spoilt", "words"),
    [
        (ts.Status.UNSTABLE, {"negative_eigenvalues": 1}, "Springs are in an unstable equilibrium, first at"),
        (ts.Status.INVERTED, {"area_ratio": -0.1}, "Springs have an element turned inside out, first at"),
    ],
)
def test_unsound_states_are_named_with_their_level(status: ts.Status, spoilt: dict[str, Any], words: str) -> None:
    problem = stretched()
    springs = path(problem, kind="springs", label="springs (lloyd)", status=status)
    states = tuple(replace(one, **spoilt) if one.load_factor >= 0.6 else one for one in springs.states)
    text = verdict(result(replace(springs, states=states), {"linear": path(problem)}))
    assert text.startswith(f"{words} load factor 0.6; ")
    assert text.endswith("Up to full load springs stay within 5 % of linear FEM. At full load: linear FEM 0 %.")


def test_a_reference_that_stops_early_is_named() -> None:
    problem = stretched()
    springs = path(problem, kind="springs", label="springs (lloyd)")
    short = path(problem, levels=(0.0, 0.2, 0.4), label="Hencky FEM", status=ts.Status.NOT_CONVERGED)
    text = verdict(result(springs, {"hencky": short, "linear": path(problem)}))
    assert text == (
        "Hencky FEM found no equilibrium beyond load factor 0.4. "
        "Springs stay within 5 % of linear FEM up to full load, and of Hencky FEM up to load factor 0.4, "
        "the last level that both reached. At full load: linear FEM 0 %. "
        "With Hencky FEM the comparison ends at load factor 0.4, there 0 %."
    )


def test_verdict_without_references() -> None:
    springs = path(stretched(), kind="springs", label="springs (lloyd)")
    assert verdict(result(springs, {})) == (
        "Springs reach full load through stable equilibria; nothing was compared with them. "
        "At full load the probe has moved by 24.0 mm."
    )


def test_a_single_model_that_is_not_springs_is_spoken_of_in_the_singular() -> None:
    problem = stretched()
    mine = path(problem, label="linear FEM")
    other = path(problem, [1 / 1.2] * 5, label="Hencky FEM")
    assert verdict(result(mine, {"hencky": other}, name="linear")) == (
        "At no load level does linear FEM come within 5 % of Hencky FEM. At full load: Hencky FEM 20 %."
    )


def test_prescribed_motion_speaks_of_motion_and_of_the_force_it_takes() -> None:
    problem = stretched(more=[ts.Fixed(on="right", fix=["x"], displacement=[0.008, 0.0])], loads=())
    springs = ts.solve(problem, ts.Springs("isotropic"))
    linear = ts.solve(problem, ts.Fem("linear"))
    found = result(springs, {"linear": linear})
    assert "full motion" in verdict(found) and "load:" not in verdict(found)
    force = [
        quantity(one.states[-1].reaction[problem.mesh.nodes[:, 0] > 0.07, 0].sum(), "N") for one in (springs, linear)
    ]
    assert force_sentence(found) == f"The force it takes at full motion: springs {force[0]}, linear FEM {force[1]}."
    assert drive(found).axis == 0 and drive(found).sign == 1


def test_a_surface_from_a_file_is_measured_by_its_outline() -> None:
    problem = stretched()
    springs = path(problem, kind="springs", label="springs (lloyd)")
    moved = springs.states[-1].positions + np.array([0.0, 0.001])
    triangles = problem.mesh.elements[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    read = ts.Path(problem, "deformed.stl", "stl", (), ts.Status.CONVERGED, surface=Surface(moved, triangles))
    found = result(springs, {"ansys": read})
    assert verdict(found).startswith("The outline lies ")
    assert verdict(found).endswith("at most 1.0 mm off that of deformed.stl at full load.")
    drawn = draw_figures(found)[over_name(found, "ansys")]
    assert segments(drawn, "reference") == len(Surface(moved, triangles).outline)


def test_closest_is_named_only_where_there_is_a_choice() -> None:
    problem = stretched()
    springs = path(problem, kind="springs", label="springs (lloyd)")
    near, far = path(problem, [1 / 1.02] * 5), path(problem, [1 / 1.3] * 5, label="Hencky FEM")
    both = result(springs, {"far": far, "near": near})
    assert closest_sentence(both) == "Nearest at full load is linear FEM, 2.0 % off."
    assert closest_sentence(result(springs, {"near": near})) is None


def test_labels_that_two_paths_share_are_told_apart() -> None:
    problem = stretched()
    springs = path(problem, kind="springs", label="springs (lloyd)")
    text = verdict(result(springs, {"coarse": path(problem), "fine": path(problem, [1 / 1.5] * 5)}))
    assert "linear FEM (coarse) up to full load" in text and "linear FEM (fine) at no load level" in text


def test_moduli_are_said_beside_the_material() -> None:
    problem = stretched()
    # Uniform tension of the summed lattice: 15/17 E and 7/17 along x, 21/19 E and 5/19 at 45 degrees.
    text = moduli_sentence(ts.solve(problem, ts.Springs("lloyd")))
    assert text is not None
    assert (
        "8.82 kPa and 0.41 along x, 11.1 kPa and 0.26 at 45 degrees; the material in its section has 10 kPa and 0.33."
        in text
    )
    assert "Bent 1 element deep, they have 1.875 times the bending stiffness EI." in text
    isotropic = moduli_sentence(ts.solve(problem, ts.Springs("isotropic")))
    assert isotropic is not None and isotropic.startswith("These springs realise the material, in every direction")


@pytest.mark.parametrize(
    ("found", "text"),
    [
        (percent(0.0214), "2.1 %"),
        (percent(0.344), "34 %"),
        (percent(1.234), "120 %"),
        (percent(0.0996), "10 %"),
        (percent(0.0), "0 %"),
        (percent(3e-6), "less than 0.01 %"),
        (percent(float("nan")), "no number"),
        (quantity(8823.53, "Pa"), "8.82 kPa"),
        (quantity(0.04, "m"), "40.0 mm"),
        (quantity(0.9999, "N"), "1000 mN"),
        (quantity(0.0, "N"), "0 N"),
        (given(-0.0428, "N"), "−42.8 mN"),
        (given(0.16, "m"), "160 mm"),
        (significant(9.996, 3), "10.0"),
    ],
)
def test_numbers_as_people_read_them(found: str, text: str) -> None:
    assert found == text


# --- figures and page -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def solved() -> Result:
    problem = stretched()
    newton = ts.Newton(load_steps=4)
    models: dict[str, Any] = {"springs": ts.Springs("lloyd"), "linear": ts.Fem("linear"), "a/b": ts.Fem("hencky")}
    paths = {name: ts.solve(problem, model, newton) for name, model in models.items()}
    return result(paths["springs"], {name: paths[name] for name in ("linear", "a/b")}, "Soft <10k & co>", "soft & wet")


def segments(figure: Any, name: str) -> int:
    """The number of lines in the one path of a figure that is called `name`."""
    (drawn,) = figure.findobj(lambda artist: artist.get_gid() == name)
    return int((drawn.get_path().codes == 1).sum())


def test_figures_hold_every_spring_edge_and_the_probe(solved: Result) -> None:
    figures = draw_figures(solved)
    assert set(figures) == {"undeformed", "springs_over_linear", "springs_over_a-b", "curves", "error", "moduli"}
    mesh, springs = solved.problem.mesh, solved.paths["springs"]
    n_springs = 13 + 8  # edges of 4 x 1 squares, and two diagonals a square
    over = figures["springs_over_linear"]
    assert segments(over, "model") == n_springs
    assert segments(over, "reference") == len(mesh.edges) == 13
    assert segments(figures["undeformed"], "springs") == n_springs
    for name, positions in (("undeformed", mesh.nodes), ("springs_over_linear", springs.states[-1].positions)):
        (dot,) = figures[name].findobj(lambda artist: artist.get_gid() == "probe")
        assert np.ravel(dot.get_data()) == pytest.approx(1e3 * positions[solved.probe])
        assert dot.get_color() == "#d3222a"
    assert figures["undeformed"].findobj(lambda artist: artist.get_gid() == "clamped")


def test_curves_carry_the_name_of_the_law_and_the_numbers_of_the_path(solved: Result) -> None:
    axes = draw_figures(solved)["curves"].axes[0]
    lines = {line.get_label(): line for line in axes.lines}
    assert set(lines) == {"springs (lloyd)", "linear FEM", "Hencky FEM, a/b"}
    written = {text.get_text() for text in axes.texts}
    assert {"springs (lloyd)", "linear FEM", "Hencky FEM"} <= written
    states = solved.paths["springs"].states
    assert lines["springs (lloyd)"].get_ydata() == pytest.approx(
        [1e3 * state.displacement[solved.probe, 0] for state in states]
    )
    assert lines["springs (lloyd)"].get_xdata() == pytest.approx([400 * state.load_factor for state in states])
    assert axes.get_xlabel() == "total force along x [mN]"
    assert axes.get_ylabel() == "displacement along x [mm]"


def test_names_at_the_ends_of_curves_keep_their_distance() -> None:
    places, ties = np.array([0.5, 0.5, 0.52, 0.98]), np.array([2.0, 1.0, 0.0, 0.0])
    moved = _apart(places, 0.1, ties)
    assert np.diff(np.sort(moved)).min() >= 0.1 - 1e-12
    assert moved[1] < moved[0] < moved[2] < moved[3]
    assert moved[:3].mean() == pytest.approx(places[:3].mean())
    assert moved.min() >= 0 and moved.max() <= 1


def test_figures_are_written_as_png_and_svg(solved: Result, tmp_path: FilePath) -> None:
    save_figures(solved, tmp_path / "figures")
    files = sorted(file.name for file in (tmp_path / "figures").iterdir())
    assert files == sorted(f"{name}.{kind}" for name in draw_figures(solved) for kind in ("png", "svg"))
    for file in (tmp_path / "figures").iterdir():
        if file.suffix == ".png":
            assert file.read_bytes().startswith(b"\x89PNG")
        else:
            assert ElementTree.parse(file).getroot().tag.endswith("svg")


def test_drawing_leaves_the_settings_of_matplotlib_alone(solved: Result) -> None:
    import matplotlib

    before = dict(matplotlib.rcParams)
    draw_figures(solved)
    assert dict(matplotlib.rcParams) == before


class Page(HTMLParser):
    """What a page loads, links to and says."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.loaded: list[str] = []
        self.links: list[str] = []
        self.tags: list[str] = []
        self.ids: list[str] = []
        self.policy = ""
        self.scripts: list[str] = []
        self.said: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        self.tags.append(tag)
        self.loaded += [values[name] for name in ("src", "srcset", "poster", "data", "action") if name in values]
        self.links += [values["href"]] if "href" in values else []
        self.ids += [values["id"]] if "id" in values else []
        if values.get("http-equiv") == "Content-Security-Policy":
            self.policy = values["content"]

    def handle_data(self, data: str) -> None:
        inside = self.tags[-1] if self.tags else ""
        (self.scripts if inside == "script" else self.said).append(data)


def test_page_loads_nothing_and_escapes_what_it_was_given(solved: Result, tmp_path: FilePath) -> None:
    write_page([solved, solved], tmp_path / "report.html", "truespring verify 'soft & wet.toml' --out out")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    page = Page(text)
    assert len(page.loaded) == 2 * 6 and all(address.startswith("data:image/") for address in page.loaded)
    assert page.links and all(link.removeprefix("#") in page.ids for link in page.links)
    assert page.policy.startswith("default-src 'none';")
    assert not {"link", "iframe", "object", "embed", "base"} & set(page.tags)
    assert "url(" not in "".join(page.said) and "@import" not in text
    assert "<10k" not in text and "Soft &lt;10k &amp; co&gt;" in text
    assert "# &lt;as written&gt;" in text
    assert len(page.ids) == len(set(page.ids))


def test_page_tells_verdict_law_advice_and_how_to_run_it_again(solved: Result) -> None:
    page = Page(render_page([solved], "truespring verify soft.toml --out out"))
    told = " ".join("".join(page.said).replace("\N{NO-BREAK SPACE}", " ").split())
    assert verdict(solved) in told
    assert told.index(verdict(solved)) < told.index("How far apart")
    for words in ("Hencky FEM a/b", "truespring verify soft.toml --out out", "scikit-fem", "1 element deep this mesh"):
        assert words in told
    assert all(warning in told for path in solved.paths.values() for warning in path.warnings)


def test_a_model_that_failed_shows_its_advice(solved: Result) -> None:
    stopped = replace(solved.paths["springs"], status=ts.Status.NOT_CONVERGED)
    page = Page(render_page([replace(solved, paths={**solved.paths, "springs": stopped})], ""))
    assert ts.Status.NOT_CONVERGED.advice in "".join(page.said)


def test_the_viewer_holds_the_positions_of_every_level(solved: Result) -> None:
    page = Page(render_page([solved], ""))
    data = json.loads(page.scripts[0])
    assert [one["name"] for one in data["paths"]] == ["springs", "linear", "a/b"]
    assert data["paths"][0]["levels"] == solved.paths["springs"].load_factors.tolist()
    clouds = [solved.problem.mesh.nodes, *(state.positions for one in solved.paths.values() for state in one.states)]
    lower, upper = np.concatenate(clouds).min(axis=0), np.concatenate(clouds).max(axis=0)
    extent = (upper - lower).max()
    for found, one in zip(data["paths"], solved.paths.values(), strict=True):
        for packed, state in zip(found["positions"], one.states, strict=True):
            steps = np.frombuffer(base64.b64decode(packed), dtype="<u2").reshape(-1, 2)
            assert lower + steps / 65535 * extent == pytest.approx(state.positions, abs=1e-5 * extent)
    lines = np.frombuffer(base64.b64decode(data["paths"][0]["lines"]), dtype="<u4")
    assert lines.size == 2 * 21 and lines.max() == solved.problem.mesh.n_nodes - 1


def test_a_page_of_a_plain_network() -> None:
    network = ts.SpringNetwork([[0, 10], [0, 0], [0, -10]], [[0, 1], [1, 2]], [1.0, 8.0])
    problem = ts.Problem(network.mesh, supports=[ts.Fixed(on=[0, 2])], loads=[ts.Force(on=[1], total=(5.0, 5.0))])
    only = ts.solve(problem, network)
    found = Result("Two springs", FilePath("vm9.toml"), problem, {"net": only}, 1, None, {}, 0.05, "")
    assert verdict(found) == "1 of 1 models reached full load; nothing was compared."
    page = Page(render_page([found], ""))
    assert len(page.loaded) == 2  # as asked, and the curve
