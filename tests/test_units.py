"""The border of units."""

import pytest

from truespring.errors import TruespringError
from truespring.units import Dimension, to_si


@pytest.mark.parametrize(
    ("given", "dimension", "wanted"),
    [
        ("3 kPa", "stress", 3000.0),
        ("3kPa", "stress", 3000.0),
        ("1e3 N/m^2", "stress", 1000.0),
        ("0.01 N/mm**2", "stress", 10e3),
        ("-43 mN", "force", -0.043),
        ("+.5 mm", "length", 5e-4),
        ("12. um", "length", 12e-6),
        ("1 inch", "length", 0.0254),
        ("1 g/cm^3", "density", 1000.0),
        ("1 kg m^-3", "density", 1.0),
        ("2 1/s", "rate", 2.0),
        ("0.5 1/ms", "rate", 500.0),
        (7, "length", 7.0),
        ("0 mm", "length", 0.0),
    ],
)
def test_quantities_become_si(given: object, dimension: Dimension, wanted: float) -> None:
    assert to_si(given, dimension) == pytest.approx(wanted, rel=1e-14)


@pytest.mark.parametrize(
    ("given", "dimension", "question"),
    [
        ("10 mPa", "stress", '10 mPa.* 0.01 Pa.* 10 MPa meant?.* "0.01 Pa"'),
        ("-2.5mPa", "stress", " -2.5 MPa meant?"),
        ("160 Mm", "length", ' 160 mm meant?.* "160000 km"'),
        ("10 mpa", "stress", "'MPa' meant?"),
        ("3 KPa", "stress", "'kPa' meant?"),
    ],
)
def test_a_unit_in_the_wrong_case_is_asked_for(given: str, dimension: Dimension, question: str) -> None:
    with pytest.raises(TruespringError, match=question.replace("?", r"\?")):
        to_si(given, dimension)
    assert to_si("0.01 Pa", "stress") == 0.01 and to_si("5 mN", "force") == 5e-3 and to_si("0 mPa", "stress") == 0


@pytest.mark.parametrize(
    "given",
    [
        "1,5 N",
        "1 000 N",
        "N",
        "",
        "1e N",
        "9**9**9 N",
        "1 N + 1 N",
        "(1) N",
        "1 N^99",
        "nan N",
        "1e400 N",
        "2 m",
        "2 lbm",
    ],
)
def test_what_is_no_force_is_refused(given: str) -> None:
    with pytest.raises(TruespringError, match="a unit of force"):
        to_si(given, "force")
