"""The reference nearest to the model."""

from truespring.report.axis import axis_of
from truespring.report.quantity import percent
from truespring.report.result import Result
from truespring.report.verdict.naming import display_name
from truespring.report.verdict.trouble import path_trouble


def nearest_reference(result: Result) -> str | None:
    """Return the name of the nearest reference; None if there are fewer than two, or the model is in trouble."""
    if result.model is None or len(result.comparisons) < 2 or path_trouble(result, result.model):
        return None
    return result.closest


def closest_sentence(result: Result) -> str | None:
    """Return the nearest reference at full load and its error; None if `nearest_reference` is None."""
    name = nearest_reference(result)
    if name is None:
        return None
    error = result.comparisons[name].rms_error
    assert error is not None  # Result.closest compares these
    what = " in displacement" if result.comparisons[name].force_error is not None else ""
    return f"Nearest{what} {axis_of(result).at_full} is {display_name(result, name)}, {percent(error)} off."
