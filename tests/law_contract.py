"""The contract of an entry of LAWS: every check takes an entry, so that one that is wrong can be shown to fail."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.integrate import quad
from scipy.optimize import root

from tests.closed_forms import VOIGT, difference_errors, lame, nominal_stress, observed_orders
from truespring.arrays import Floats
from truespring.material import Lame
from truespring.models import Law
from truespring.models.law import Constants, Response

#: Poisson's ratios of the materials that a law is tried with; one with Lame constants of its own has its own.
RATIOS = (-0.2, 0.3, 0.45)
STEPS = (2e-2, 1e-2, 5e-3)


@dataclass(frozen=True)
class Body:
    """A law with constants, in the plane or in space."""

    law: Law
    constants: Constants
    dim: int

    def respond(self, strain: Floats) -> Response:
        """The response to a strain, shape (dim, dim)."""
        return self.law.respond(voigt(strain), self.constants)

    def energy(self, strain: Floats) -> float:
        return float(self.respond(strain).energy[0, 0])

    def stress(self, strain: Floats) -> Floats:
        """Shape (dim, dim)."""
        return matrix(self.respond(strain).stress)

    def elasticity(self, strain: Floats) -> Floats:
        """In Voigt's order, shape (components, components)."""
        return np.asarray(self.respond(strain).elasticity().dense(voigt(strain))[..., 0, 0])

    def strain(self, stretch: Floats) -> Floats:
        """The strain that the law takes, of stretches along the axes, shape (dim, dim)."""
        return np.diag(stretch**2 if self.law.finite else stretch - 1)

    @property
    def rest(self) -> Floats:
        return self.strain(np.ones(self.dim))

    def green(self, change: Floats) -> Floats:
        """What a change of the Green strain changes in the strain that the law takes."""
        return 2 * change if self.law.finite else change


def voigt(tensor: Floats) -> Floats:
    """Axes (component, element, point), of one point."""
    return np.array([tensor[pair] for pair in VOIGT[len(tensor)]], dtype=float)[:, None, None]


def matrix(components: Floats) -> Floats:
    dim = {3: 2, 6: 3}[len(components)]
    full = np.empty((dim, dim))
    for (i, j), component in zip(VOIGT[dim], components[:, 0, 0], strict=True):
        full[i, j] = full[j, i] = component
    return full


def bodies(law: Law, ratios: tuple[float, ...] = RATIOS) -> list[Body]:
    """The law in space, in plane strain and in plane stress, with several materials."""
    values = {name: constant.example for name, constant in law.constants.items()}
    pairs = [Lame(*lame(3.0, ratio)) for ratio in ratios] if law.lame is None else [law.lame(values)]
    return [
        Body(law, Constants(pair.lam, pair.mu, free, values), dim)
        for pair in pairs
        for dim, free in ((3, False), (2, False), (2, True))
    ]


def nominal(body: Body, stretch: Floats) -> Floats:
    """Nominal stresses of the closed form [Pa], shape (3,)."""
    return nominal_stress(body.law, body.constants, stretch)


def settled(body: Body, stretch: Floats, free: list[bool]) -> Floats:
    """Three stretches, those that are free such that the closed form has no stress there."""
    found, at = np.array(stretch, dtype=float), np.array(free)
    if at.any():

        def stress(unknown: Floats) -> Floats:
            found[at] = unknown
            return nominal(body, found)[at]

        solved = root(stress, found[at], tol=1e-14)
        assert np.abs(solved.fun).max() < 1e-11 * body.constants.mu, "the closed form has no free stretch here"
        found[at] = solved.x
    return found


def in_section(body: Body, stretch: Floats) -> Floats:
    """Three stretches of the body's: in the plane the third is 1, or free of stress."""
    if body.dim == 3:
        return stretch
    return settled(body, np.array([*stretch[:2], 1.0]), [False, False, body.constants.plane_stress])


def rotation(dim: int) -> Floats:
    found, _ = np.linalg.qr(np.random.default_rng(dim).normal(size=(dim, dim)))
    return np.asarray(found * np.sign(np.linalg.det(found)))


def close(found: object, expected: object, size: float, share: float = 1e-9) -> bool:
    return bool(np.abs(np.asarray(found) - np.asarray(expected)).max() <= share * size)


# --- the checks -------------------------------------------------------------------------------------------------------


def check_rest(law: Law) -> None:
    """No energy and no stress at rest; the elasticity there is that of lam and mu, volume and shear apart."""
    for body in bodies(law):
        size = abs(body.constants.lam) + body.constants.mu
        assert close(body.energy(body.rest), 0.0, size, 1e-14)
        assert close(body.stress(body.rest), 0.0, size, 1e-14)
        found, dim = body.elasticity(body.rest), body.dim
        lam, mu = body.constants.lam_plane, body.constants.mu
        swelling = np.arange(len(found)) < dim
        assert close(found[swelling][:, swelling].sum() / dim**2, lam + 2 * mu / dim, size), "bulk modulus"
        assert close(found[~swelling][:, ~swelling], mu * np.eye((~swelling).sum()), size), "shear modulus"
        assert close(found[0, 0] - found[0, 1], 2 * mu, size), "shear modulus along the axes"
        assert close(found[swelling][:, ~swelling], 0.0, size)


def check_closed_form(law: Law) -> None:
    """Energy and stress are those of the formula in principal stretches: pulled, swollen and shrunk, and in general."""
    for body in bodies(law):
        size = abs(body.constants.lam) + body.constants.mu
        for stretch in ([1.4, 1.0, 1.0], [1.2, 1.2, 1.2], [0.8, 0.8, 0.8], [1.3, 0.85, 1.1], [0.75, 1.1, 0.9]):
            three = in_section(body, np.array(stretch))
            turn = rotation(body.dim) if law.finite else np.eye(body.dim)
            strain = turn @ body.strain(three[: body.dim]) @ turn.T
            density = float(np.real(law.density(three, body.constants)))
            assert close(body.energy(strain), density, size), f"energy at {stretch}"
            expected = nominal(body, three)
            second = expected / three if law.finite else expected
            assert close(body.stress(strain), turn @ np.diag(second[: body.dim]) @ turn.T, size), f"stress at {stretch}"
            response = body.respond(strain)
            thickness = three[2] if body.dim == 2 else 1.0
            assert close(response.thickness_stretch[0, 0], thickness, 1.0), f"thickness at {stretch}"
            if body.dim == 2:
                across = expected[2] * three[2] if law.finite else expected[2]
                assert close(response.across[0, 0], across, size), f"stress across the plane at {stretch}"


def check_mechanical_tests(law: Law) -> None:
    """A bar, a sheet stretched in two directions, and simple shear are those of the formula, thickness included."""
    for body in bodies(law):
        size = abs(body.constants.lam) + body.constants.mu
        across = body.dim == 3 or body.constants.plane_stress
        for stretch, free in (([0.8, 1.1, 1.1], [False, True, across]), ([1.4, 0.9, 0.9], [False, True, across])):
            three = settled(body, np.array([*stretch[:2], stretch[2] if across else 1.0]), free)
            check_state(body, np.diag(three[: body.dim]), three, np.eye(3), size)
        sheet = settled(body, np.array([1.2, 1.2, 1.0]), [False, False, across])
        check_state(body, np.diag(sheet[: body.dim]), sheet, np.eye(3), size)
        if law.finite:
            shear = np.eye(3)
            shear[0, 1] = 0.5
            values, axes = np.linalg.eigh(shear.T @ shear)
            order = np.argsort(np.abs(axes[2]))  # the direction across the plane last
            three = settled(body, np.sqrt(values[order]), [False, False, body.constants.plane_stress])
            check_state(body, shear[: body.dim, : body.dim], three, axes[:, order], size)


def check_state(body: Body, gradient: Floats, three: Floats, axes: Floats, size: float) -> None:
    """The stress at a deformation gradient is that of the formula at three stretches along `axes`."""
    eye = np.eye(body.dim)
    response = body.respond(gradient.T @ gradient if body.law.finite else (gradient + gradient.T) / 2 - eye)
    expected = nominal(body, three)
    second = axes @ np.diag(expected / three if body.law.finite else expected) @ axes.T
    assert close(matrix(response.stress), second[: body.dim, : body.dim], size), f"stress at {three}"
    if body.dim == 2:
        assert close(response.thickness_stretch[0, 0], three[2], 1.0), f"thickness at {three}"


def check_invariants(law: Law) -> None:
    """The function of I1 and ln J is the formula, with exact derivatives; linear in I1 where the entry says so."""
    if law.invariants is None:
        assert not law.constant_springs
        return
    step = 1e-30j
    for body in bodies(law):
        if body.dim == 2:
            continue
        law_of, size = law.invariants, abs(body.constants.lam) + body.constants.mu
        stretches = np.random.default_rng(31).uniform(0.75, 1.35, (20, 3))
        I1, y = (stretches**2).sum(axis=1), np.log(stretches).sum(axis=1)
        at = law_of(I1, y, body.constants)
        assert at.linear == law.constant_springs
        density = [np.real(law.density(stretch, body.constants)) for stretch in stretches]
        assert close(at.energy, density, size, 1e-13)
        by_trace, by_y = law_of(I1 + step, y + 0j, body.constants), law_of(I1 + 0j, y + step, body.constants)
        for found, change in (
            (at.by_trace, by_trace.energy),
            (at.by_y, by_y.energy),
            (at.by_trace_trace, by_trace.by_trace),
            (at.by_trace_y, by_y.by_trace),
            (at.by_trace_y, by_trace.by_y),
            (at.by_y_y, by_y.by_y),
        ):
            assert close(found, np.imag(change) / step.imag, size, 1e-12)


def check_volume(law: Law) -> None:
    """Swollen alike in every direction the energy is the work of the pressure of the formula, at small strain 9 K/2."""
    for body in bodies(law):
        if body.dim == 2:
            continue

        def pull(stretch: float, body: Body = body) -> float:
            return float(nominal(body, np.full(3, stretch)).sum())

        bulk = body.constants.lam + 2 * body.constants.mu / 3
        assert close(pull(1 + 1e-6) / 9e-6, bulk, bulk, 1e-4), "bulk modulus of the formula"
        for stretch in (0.7, 1.35):
            work, _ = quad(pull, 1.0, stretch, epsabs=1e-13)
            assert close(body.energy(body.strain(np.full(3, stretch))), work, bulk), f"swollen by {stretch}"


def check_derivatives(law: Law) -> None:
    """Stress and elasticity are derivatives by the Green strain, at a deformed state, by observed order or exactly."""
    for body in bodies(law):
        generator = np.random.default_rng(271)
        gradient = np.eye(body.dim) + generator.uniform(-0.2, 0.2, (body.dim,) * 2)
        strain = gradient.T @ gradient if law.finite else (gradient + gradient.T) / 2 - np.eye(body.dim)
        change = generator.normal(size=(body.dim,) * 2) / 4
        for errors in derivative_errors(body, strain, change + change.T):
            if law.quadratic:
                assert errors.max() < 1e-11
            else:
                assert errors[0] > 1e-9, "there is nothing to see an order in"
                assert np.abs(observed_orders(errors, STEPS) - 2).max() < 0.15


def derivative_errors(body: Body, strain: Floats, change: Floats) -> tuple[Floats, Floats]:
    """Errors of central differences of energy and stress along a change of the Green strain, by step."""
    doubled = np.array([1.0 if i == j else 2.0 for i, j in VOIGT[body.dim]])
    work = float((body.stress(strain) * change).sum())
    slope = body.elasticity(strain) @ (doubled * voigt(change)[:, 0, 0])

    def moved(step: float) -> Floats:
        return np.asarray(strain + body.green(step * change))

    return (
        difference_errors(lambda step: np.array([body.energy(moved(step))]), np.array([work]), STEPS),
        difference_errors(lambda step: voigt(body.stress(moved(step)))[:, 0, 0], slope, STEPS),
    )


def check_isotropy(law: Law) -> None:
    """A turned strain has the turned stress and the same energy."""
    for body in bodies(law, (0.3,)):
        strain = body.strain(np.array([1.3, 0.85, 1.1])[: body.dim])
        strain[0, 1] = strain[1, 0] = 0.1
        turn, size = rotation(body.dim), body.constants.mu
        turned = turn @ strain @ turn.T
        assert close(body.energy(turned), body.energy(strain), size, 1e-12)
        assert close(body.stress(turned), turn @ body.stress(strain) @ turn.T, size, 1e-12)


def check_current(law: Law) -> None:
    """The response in current axes is that of the reference with F at each direction of stress and elasticity."""
    if law.current is None:
        return
    for body in bodies(law, (0.3,)):
        F = np.diag([1.3, 0.85, 1.1][: body.dim]) + 0.1 * rotation(body.dim)
        reference, current = body.respond(F.T @ F), law.current(voigt(F @ F.T), body.constants)
        size, pairs = abs(body.constants.lam) + body.constants.mu, VOIGT[body.dim]
        assert close(current.energy, reference.energy, size, 1e-12)
        assert close(matrix(current.stress), F @ matrix(reference.stress) @ F.T, size, 1e-12)
        assert close(current.thickness_stretch, reference.thickness_stretch, 1.0, 1e-12)
        full = np.empty((body.dim,) * 4)
        for one, (i, j) in enumerate(pairs):
            for two, (k, m) in enumerate(pairs):
                component = body.elasticity(F.T @ F)[one, two]
                full[i, j, k, m] = full[j, i, k, m] = full[i, j, m, k] = full[j, i, m, k] = component
        pushed = np.einsum("ia,jb,kc,ld,abcd->ijkl", F, F, F, F, full)
        expected = [[pushed[(*one, *two)] for two in pairs] for one in pairs]
        assert close(current.elasticity().dense(current.stress)[..., 0, 0], expected, size, 1e-11)


def check_section(law: Law) -> None:
    """The plane is the space of the thickness stretch that the law says: energy and stresses are the same."""
    for body in bodies(law):
        if body.dim == 3:
            continue
        space = Body(law, Constants(body.constants.lam, body.constants.mu, False, body.constants.values), 3)
        strain, size = body.strain(np.array([1.25, 0.9])), abs(body.constants.lam) + body.constants.mu
        strain[0, 1] = strain[1, 0] = 0.07
        thickness = float(body.respond(strain).thickness_stretch[0, 0])
        whole = space.strain(np.array([1.0, 1.0, thickness]))
        whole[:2, :2] = strain
        assert close(body.energy(strain), space.energy(whole), size)
        stress = space.stress(whole)
        assert close(body.stress(strain), stress[:2, :2], size)
        assert close(stress[2, 2], 0.0, size) if body.constants.plane_stress else thickness == 1.0


def check_facts(law: Law) -> None:
    """What an entry declares holds: barrier, quadratic energy, lambda's part, the range where a bar is stable."""
    assert law.label and law.source
    for body in bodies(law, (0.3,)):
        if body.dim == 2:
            continue
        deformed = body.strain(np.array([1.3, 0.85, 1.1]))
        lam, mu = body.constants.lam, body.constants.mu
        with np.errstate(over="ignore", invalid="ignore"):
            flat = [body.energy(body.strain(np.array([1.0, 1.0, share]))) for share in (1e-20, 1e-40, 1e-80)]
        grows = all(more > less > mu or more == np.inf for less, more in pairwise(flat))
        assert grows == law.barrier, "energy of an element that is pressed flat"
        same = close(body.elasticity(deformed), body.elasticity(body.rest), mu, 1e-12)
        assert same == law.quadratic, "constant elasticity"
        if law.trace is not None:
            without = Body(law, Constants(0.0 * lam, mu, False, body.constants.values), 3)
            stretch = np.array([1.3, 0.85, 1.1])
            trace = {"small": stretch - 1, "green": (stretch**2 - 1) / 2, "logarithmic": np.log(stretch)}[law.trace]
            part = body.energy(deformed) - without.energy(deformed)
            assert close(part, lam / 2 * trace.sum() ** 2, mu), "lambda's part"
    for body in bodies(law, (0.49,)):
        if body.dim == 3:
            check_domain(body)


def check_domain(body: Body) -> None:
    """The force of a bar rises with its length within the domain, and falls just outside of it."""

    def force(stretch: float, guess: float) -> tuple[float, float]:
        three = settled(body, np.array([stretch, guess, guess]), [False, True, True])
        return float(nominal(body, three)[0]), float(three[1])

    lowest, highest = body.law.domain

    def slope(stretch: float) -> float:
        guess = stretch**-0.3
        return force(stretch * 1.0005, guess)[0] - force(stretch * 0.9995, guess)[0]

    for stretch in (0.3, 0.5, 0.8, 1.0, 1.5, 2.5, 4.0):
        if 1.01 * lowest < stretch < 0.99 * highest:
            assert slope(stretch) > 0, f"a bar at a stretch of {stretch}"
    for edge, beyond in ((lowest, 0.98), (highest, 1.02)):
        if 0 < edge < np.inf:
            assert slope(edge * beyond) < 0, f"a bar beyond {edge}"


CHECKS = (
    check_rest,
    check_closed_form,
    check_mechanical_tests,
    check_invariants,
    check_volume,
    check_derivatives,
    check_isotropy,
    check_current,
    check_section,
    check_facts,
)
