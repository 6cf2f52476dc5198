"""Verdict and report of a result."""

from pathlib import Path

from truespring.outputs import write_whole, writing_file
from truespring.report.page import render_page
from truespring.report.result import Result
from truespring.report.verdict import verdict


def verdict_of(result: Result) -> str:
    """Return the verdict of a result, see `Result.verdict`."""
    return verdict(result)


def write_report(result: Result, file: Path) -> Path:
    """Write the page of a result, see `Result.report`."""
    with writing_file(file):
        file.parent.mkdir(parents=True, exist_ok=True)
        write_whole(file, render_page([result], None).encode())
    return file
