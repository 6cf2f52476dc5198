"""Rows of docs/verification.md on following loads, paths past limit points, and buckling columns."""

import math
from collections.abc import Callable, Iterator

import numpy as np
from tests.closed_forms import bending_factor, elastica_tip, pressed_pipe, shallow_truss_limit
from tests.test_loads import pipe
from tests.test_network import FORCE, LIMITS, dome, shallow_truss

import truespring as ts

#: Quantity, computed value, exact value, source; and for finite elements their discretisation error.
Found = tuple[str, float, float, str] | tuple[str, float, float, str, ts.OwnError]


def trusses() -> Iterator[Found]:
    """Yield limit loads of the von Mises truss and of the star dome."""
    for rise in LIMITS:
        limit = shallow_truss_limit(1.0, rise, 1 / math.hypot(1.0, rise))[1]
        network = shallow_truss(rise)
        problem = ts.Problem(network.mesh, supports=ts.Fixed([0, 2]), loads=ts.Force([1], (0.0, -limit)))
        path = ts.solve(problem, network, ts.DisplacementControl([1], "y", to=-2.4 * rise, steps=24))
        first, second = (state.load_factor * limit for state in path.states if state.critical == "limit point")
        source = "2 EA (1 - r)^(3/2), r = (c / L)^(2/3)"
        yield f"von Mises truss, rise {rise:g}: limit load over EA", first, limit, source
        yield f"von Mises truss, rise {rise:g}: second limit load", second, -limit, source
    network = dome(published=True)
    supports, load = ts.Fixed(list(range(7, 13))), ts.Force([0], (0.0, 0.0, -FORCE))
    problem = ts.Problem(network.mesh, supports=supports, loads=load)
    path = ts.solve(problem, network, ts.DisplacementControl([0], "z", to=-1.0, steps=20))
    limit_point = next(state for state in path.states if state.critical == "limit point")
    source = "Levy and Spillers 2.4.2, geometry; a separate path-following"
    yield "star dome: first limit load over 220.46", limit_point.load_factor, 0.66578, source
    yield "star dome: crown's deflection there", -float(limit_point.displacement[0, 2]), 0.302, source
    yield "star dome: load at a deflection of 1", path.states[-1].load_factor, -0.457504, source


def columns() -> Iterator[Found]:
    """Yield buckling loads of clamped columns of Lloyd's springs over Euler's load of the material."""
    for depth in (2, 4):
        path = column(depth, 40)
        first = next(state for state in path.states if state.critical == "bifurcation")
        exact = bending_factor(5 / 16, 7 / 16, depth)
        what = f"column, L/H = 40, {depth} elements deep: buckling load over pi^2 E I / 4 L^2"
        yield what, 1.2 * first.load_factor, exact, "EI of the springs, closed form"


def column(depth: int, slender: int) -> ts.Solution:
    """Return the path of a clamped column of Lloyd's springs, compressed by 1.2 times Euler's load of its material."""
    load = -1.2 * math.pi**2 / (4 * slender**2) / 12
    problem = ts.Problem(
        ts.rectangle((float(slender), 1.0), (slender * depth, depth)),
        ts.Material(1.0, 1 / 3),
        ts.PlaneStress(1.0),
        ts.Fixed("left"),
        ts.Force("right", (load, 0.0)),
    )
    return ts.solve(problem, ts.Springs("lloyd"), ts.ArcLength(load_steps=6))


def circles() -> Iterator[Found]:
    """Yield a strip bent to a full circle by a following moment, and the cantilever under end shear of Sze, Liu, Lo."""
    for depth in (2, 4):
        problem, path = circle(depth)
        end = problem.mesh.nodes[:, 0] == 40.0
        place = path.states[-1].positions[end].mean(axis=0) - (0.0, 0.5)
        what = f"strip, L/H = 40, {depth} elements deep, M = 2 pi EI / L: distance of its ends over L"
        yield what, float(np.linalg.norm(place)) / 40, 0.0, "a full circle, EI that of the springs"
    for alpha, table in ((1.0, 3.015), (2.0, 4.933), (4.0, 6.698)):
        mesh = ts.rectangle((20.0, 1.0), (160, 8))
        factor = bending_factor(3 / 8, 3 / 8, 8)
        load = ts.Force("right", (0.0, -alpha * factor / 12 / 400))
        problem = ts.Problem(mesh, ts.Material(1.0, 1 / 3), ts.PlaneStress(1.0), ts.Fixed("left"), load)
        state = ts.solve(problem, ts.Springs("isotropic")).states[-1]
        found = -float(state.displacement[ts.named_point(mesh, "right-middle"), 1]) / 20
        what = f"end shear, P L^2 / EI(n) = {alpha:g}, L/H = 20, isotropic springs, n = 8: deflection over L"
        yield what, found, elastica_tip(alpha)[1], f"the elastica; Sze, Liu, Lo 2004 have {table / 10:.4f}"


def circle(depth: int) -> tuple[ts.Problem, ts.Solution]:
    """Return problem and solution of a strip of isotropic springs, L/H = 40, under M = 2 pi EI(n) / L at its end."""
    moment = 2 * math.pi * bending_factor(3 / 8, 3 / 8, depth) / 12 / 40
    problem = ts.Problem(
        ts.rectangle((40.0, 1.0), (40 * depth, depth)),
        ts.Material(1.0, 1 / 3),
        ts.PlaneStress(1.0),
        ts.Fixed("left"),
        ts.Moment("right", moment),
    )
    return problem, ts.solve(problem, ts.Springs("isotropic"), ts.Newton(load_steps=20))


def loads() -> Iterator[Found]:
    """Yield a pipe under pressure and a hanging bar, by finite elements."""
    exact = 1.3 / (1000 * 3) * (0.4 + 4)
    once, steps = ts.Newton(load_steps=1), ts.Newton(load_steps=20)
    for n in (8, 16, 32):
        problem, model = pipe(n), ts.Fem("linear")
        state = ts.solve(problem, model, once).states[-1]
        what = f"pipe, b = 2 a, under pressure, {n} elements through the wall: radial displacement"
        yield what, float(state.displacement[0, 0]), exact, "Lame", ts.reference_error(problem, model, once)
    _, energy = pressed_pipe(150.0, 1000.0, 0.3, 1.0, 2.0)
    for n in (4, 8, 16):
        problem, model = pipe(n, loads=ts.Pressure(pipe(n).loads[0].on, 150.0)), ts.Fem("neo-hookean")
        state = ts.solve(problem, model, steps).states[-1]
        what = f"pipe under 0.15 E, neo-Hookean, {n} elements through the wall: stored energy"
        source = "the equation along the radius, integrated; `tests/closed_forms.py`"
        yield what, state.energy, energy / 4, source, ts.reference_error(problem, model, steps)
    problem = ts.Problem(
        ts.rectangle((0.2, 0.05), (4, 1)),
        ts.Material(1e5, 0.0, density=1000.0),
        ts.PlaneStress(0.01),
        ts.Fixed("left"),
        ts.Gravity((9.81, 0.0)),
    )
    state = ts.solve(problem, ts.Fem("linear"), once).states[-1]
    own = ts.reference_error(problem, ts.Fem("linear"), once)
    exact = 1000 * 9.81 * 0.2**2 / 2e5
    yield "hanging bar: elongation", float(state.displacement[-1, 0]), exact, "rho g L^2 / 2 E", own


ROWS: tuple[Callable[[], Iterator[Found]], ...] = (trusses, columns, circles, loads)
