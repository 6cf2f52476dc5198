"""Rebuild docs/images/theory/, the figures of docs/theory/.

Run from the root of the repository: python docs/build_theory.py (or make verification).
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import truespring as ts
from truespring.arrays import Floats
from truespring.mesh import ELEMENT_KINDS
from truespring.mesh.kinds import ElementKind, Links
from truespring.report.style import BLUE, FAINT, INK, LOAD, MOTION, RED, figure_style

OUT = Path(__file__).parent / "images" / "theory"
YOUNG = 1.0

# Corners of the undeformed elements, in the order of their nodes.
_SQUARE = ((0, 0), (1, 0), (1, 1), (0, 1))
CORNERS: dict[str, tuple[tuple[float, ...], ...]] = {
    "triangle": ((0, 0), (1, 0), (0.5, 0.87)),
    "quadrilateral": _SQUARE,
    "tetrahedron": ((0, 0, 0), (1, 0, 0), (0.35, 0.95, 0), (0.45, 0.35, 0.95)),
    "pyramid": (*((*corner, 0) for corner in _SQUARE), (0.5, 0.5, 0.9)),
    "wedge": tuple((x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (0.4, 0.9))),
    "hexahedron": tuple((x, y, z) for z in (0, 1) for x, y in _SQUARE),
}


def on_paper(points: Floats) -> Floats:
    """Return points of the plane as they are, of space in an oblique projection, shape (n, 2)."""
    if points.shape[1] == 2:
        return points
    x, y, z = points.T
    return np.stack([x + 0.42 * y, z + 0.3 * y], axis=1)


def element(ax: Axes, name: str, kind: ElementKind, chosen: Links, color: str, title: str) -> None:
    """Draw the springs `chosen` with their numbers among the links of an element, and the numbers of its nodes."""
    at = on_paper(np.array(CORNERS[name], dtype=float))
    for first, second in kind.edges:
        ax.plot(*at[[first, second]].T, color=FAINT, lw=1, zorder=1)
    for number, (first, second) in enumerate(kind.links):
        if (first, second) in chosen:
            ax.plot(*at[[first, second]].T, color=color, lw=1.6, zorder=2)
            # Away from the middle, where several diagonals cross.
            share = 0.5 if (first, second) in kind.edges else 0.36
            place = (1 - share) * at[first] + share * at[second]
            label = {"facecolor": "white", "edgecolor": "none", "pad": 0.6}
            ax.text(*place, str(number), color=color, ha="center", va="center", fontsize=8, bbox=label, zorder=3)
    for number, place in enumerate(at):
        ax.text(*place, str(number), color="white", ha="center", va="center", fontsize=7.5, zorder=5)
    ax.plot(*at.T, "o", ms=11, color=INK, zorder=4)
    ax.set_title(title, fontsize=9)
    ax.set_aspect("equal")
    ax.margins(0.14)
    ax.axis("off")


def numbering() -> Figure:
    """Nodes and springs of every kind of element, in the order of the program."""
    kinds = {name: kind for name, kind in ELEMENT_KINDS.items() if kind.dim > 1}
    sets = ("edges", "diagonals", "body_diagonals")
    panels = [
        (name, kind, field, getattr(kind, field))
        for name, kind in kinds.items()
        for field in sets
        if getattr(kind, field)
    ]
    figure = Figure(figsize=(10, 7.2), layout="constrained")
    axes = figure.subplots(3, -(-len(panels) // 3)).ravel()
    colors = dict(zip(sets, (BLUE, RED, MOTION), strict=True))
    for ax, (name, kind, field, chosen) in zip(axes, panels, strict=False):
        element(ax, name, kind, chosen, colors[field], f"{name}: {field.replace('_', ' ')}")
    for ax in axes[len(panels) :]:
        ax.axis("off")
    return figure


def plate() -> ts.Problem:
    """A square of unit Young's modulus and thickness."""
    return ts.Problem(
        mesh=ts.rectangle(size=(1.0, 1.0), elements=(4, 4)),
        material=ts.Material(young=YOUNG, poisson=1 / 3),
        section=ts.PlaneStress(thickness=1.0),
        supports=[ts.Fixed(on="left")],
        loads=[ts.Force(on="right", total=(0.1, 0.0))],
    )


def lattice(ax: Axes, rule: str) -> None:
    """Draw the springs of a rule on squares; a line is as wide as the spring is stiff."""
    springs = ts.solve(plate(), ts.Springs(rule)).potential
    for (first, second), stiffness in zip(springs.springs, springs.stiffness, strict=True):
        ax.plot(*springs.nodes[[first, second]].T, color=BLUE, lw=7 * stiffness, solid_capstyle="round")
    ax.set_title(
        f"{rule}: boundary {springs.stiffness.min():.4g}, inner edges {springs.stiffness.max():.4g}", fontsize=9
    )
    ax.set_aspect("equal")
    ax.axis("off")


def lattices() -> Figure:
    """The square lattices of two rules, and Young's modulus over the direction of the pull."""
    figure = Figure(figsize=(10, 3.4), layout="constrained")
    rules = {"lloyd": BLUE, "isotropic": RED}
    axes = [figure.add_subplot(1, 3, 1 + k) for k in range(2)]
    for ax, rule in zip(axes, rules, strict=True):
        lattice(ax, rule)
    polar = figure.add_subplot(1, 3, 3, projection="polar")
    angles = np.arange(0, 361, 3)
    for rule, color in rules.items():
        moduli = ts.moduli(plate(), ts.Springs(rule))
        polar.plot(np.radians(angles), [moduli.young(float(a)) / YOUNG for a in angles], color=color, label=rule)
    polar.set_title("effective Young's modulus over that of the material", fontsize=9)
    polar.set_rlim(0, 1.2)
    polar.set_rticks([0.5, 1.0])
    polar.legend(loc="lower left", bbox_to_anchor=(-0.25, -0.12), frameon=False)
    return figure


def stretched(model: ts.Springs, stretches: Floats) -> Floats:
    """Return the nominal stress of one square in uniaxial tension, by solving for prescribed ends."""
    stresses = []
    for stretch in stretches:
        problem = ts.Problem(
            mesh=ts.rectangle(size=(1.0, 1.0), elements=(1, 1)),
            material=ts.Material(young=YOUNG, poisson=1 / 3),
            section=ts.PlaneStress(thickness=1.0),
            supports=[
                ts.Fixed(on="left", fix=["x"]),
                ts.Fixed(on="bottom", fix=["y"]),
                ts.Fixed(on="right", fix=["x"], displacement=(stretch - 1, 0.0)),
            ],
            loads=[],
        )
        last = ts.solve(problem, model).states[-1]
        right = problem.mesh.nodes[:, 0] == 1
        stresses.append(last.reaction[right, 0].sum())
    return np.array(stresses)


def neo_hookean(stretches: Floats) -> Floats:
    """Return the closed form of the nominal stress [E] of a bar, from the section of the law with free sides.

    mu (b - 1) + lam ln(a b) = 0 gives b, the squared stretch across, at a squared stretch along of a^2.
    """
    mu, lam = YOUNG / (2 * (1 + 1 / 3)), YOUNG / 3 / ((1 + 1 / 3) * (1 - 2 / 3))
    stresses = []
    for a in stretches:
        low, high = 1e-6, 4.0
        for _ in range(80):
            b = (low + high) / 2
            low, high = (b, high) if mu * (b - 1) + lam * np.log(a * b) < 0 else (low, b)
        stresses.append(mu * (a - 1 / a) + lam * np.log(a * b) / a)
    return np.array(stresses)


def tension() -> Figure:
    """Nominal stress over stretch: straight springs, springs with a pair law, Gaussian springs, the law itself."""
    figure = Figure(figsize=(6.4, 4), layout="constrained")
    ax = figure.subplots()
    stretches = np.linspace(0.6, 2, 28)
    ax.plot(stretches, neo_hookean(stretches), color=INK, lw=4, alpha=0.35, label="neo-Hookean law, closed form")
    for name, model, style in (
        ("isotropic, straight", ts.Springs("isotropic"), {"color": RED}),
        ("isotropic, pair forces of the law", ts.Springs("isotropic", law="neo-hookean"), {"color": LOAD, "ls": "--"}),
        ("gaussian", ts.Springs("gaussian"), {"color": BLUE, "ls": ":", "lw": 2.2}),
    ):
        ax.plot(stretches, stretched(model, stretches), label=name, **style)
    ax.set(xlabel="stretch", ylabel="nominal stress / E", title="A square in uniaxial tension, Poisson's ratio 1/3")
    ax.legend(frameon=False)
    return figure


def bending() -> Figure:
    """The bending stiffness of a strip n elements deep over that of the material."""
    figure = Figure(figsize=(6.4, 3.6), layout="constrained")
    ax = figure.subplots()
    depth = np.arange(1, 13)
    for rule, color in (("lloyd", BLUE), ("isotropic", RED)):
        moduli = ts.moduli(plate(), ts.Springs(rule))
        ax.plot(depth, [moduli.bending.get(n, np.nan) for n in depth], "o", color=color)
        a, b = (5 / 16, 7 / 16) if rule == "lloyd" else (3 / 8, 3 / 8)
        young = 4 * a * (a + b) / (2 * a + b)
        ax.plot(depth, young * (1 - 1 / depth**2) + 6 * a / depth**2, color=color, label=rule)
    ax.plot(depth, 1 + 0.5 / depth**2, color=INK, label="four-node elements")
    ax.axhline(1, color=FAINT, lw=0.8, zorder=0)
    ax.set(xlabel="elements through the depth", ylabel="EI / EI of the material", ylim=(0.8, 2.3))
    ax.legend(frameon=False)
    return figure


def damping() -> Figure:
    """Amplitude that a step leaves of an undamped oscillation, over the angle of a step."""
    figure = Figure(figsize=(6.4, 3.6), layout="constrained")
    ax = figure.subplots()
    angle = np.linspace(1e-3, 4, 300)
    euler = 1 / np.sqrt(1 + angle**2)
    # 3/2 x - 2 x' + 1/2 x'' = i angle x for a factor x a step: the root that is 1 at angle 0.
    bdf2 = np.abs((2 + np.sqrt(1 + 2j * angle)) / (3 - 2j * angle))
    for label, factor, style in (
        ("euler", euler, {"color": RED}),
        ("bdf2", bdf2, {"color": BLUE}),
        ("midpoint", np.ones_like(angle), {"color": INK}),
        ("leapfrog, up to angle 2", np.where(angle <= 2, 1.0, np.nan), {"color": MOTION, "ls": "--"}),
    ):
        ax.plot(angle, factor, label=label, **style)
    ax.set(xlabel="angular frequency x step", ylabel="amplitude kept by a step", ylim=(0, 1.05))
    ax.legend(frameon=False)
    return figure


FIGURES: dict[str, Callable[[], Figure]] = {
    "numbering": numbering,
    "lattices": lattices,
    "tension": tension,
    "bending": bending,
    "damping": damping,
}


def main() -> None:
    OUT.mkdir(parents=True, exist_ok=True)
    with figure_style():
        for name, draw in FIGURES.items():
            figure = draw()
            FigureCanvasAgg(figure)
            figure.savefig(OUT / f"{name}.svg", metadata={"Date": None})


if __name__ == "__main__":
    main()
