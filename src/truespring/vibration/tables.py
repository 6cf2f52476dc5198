"""Modes as a table for a terminal."""

from typing import TYPE_CHECKING

from truespring.report.tables import new_table
from truespring.vibration.beside import StudyModes, off_words

if TYPE_CHECKING:
    from rich.table import Table


def mode_table(found: StudyModes) -> "Table":
    """Return a table: for each mode of the reference the frequencies of all models, differences in % and MAC.

    Below are the modes of the other models whose shape no mode of the reference has.
    """
    others = list(found.pairs)
    columns = [text for name in others for text in (f"{name} [Hz]", "off", "MAC")]
    table = new_table(f"{found.stem}: {found.title}", "mode", f"{found.reference} [Hz]", *columns)
    for number in found.shown(found.reference):
        cells = [cell for name in others for cell in _compared(found, name, number)]
        table.add_row(str(number + 1), _hertz(found.found[found.reference].frequencies[number]), *cells)
    for place, name in enumerate(others):
        for mode in sorted(set(found.shown(name)) - {pair.mode for pair in found.pairs[name]}):
            before, after = [""] * (3 * place), [""] * (3 * (len(others) - place - 1))
            own = f"{mode + 1}: {_hertz(found.found[name].frequencies[mode])}"
            table.add_row("-", "-", *before, own, "-", "-", *after)
    return table


def rigid_line(found: StudyModes) -> str:
    """Return how many rigid-body motions each model has, as a sentence; empty if none has any."""
    counts = {name: modes.n_rigid for name, modes in found.found.items()}
    if not any(counts.values()):
        return ""
    if len(set(counts.values())) == 1:
        return f"rigid-body motions, at 0 Hz and not listed: {next(iter(counts.values()))}"
    return f"rigid-body motions, at 0 Hz and not listed: {', '.join(f'{name} {n}' for name, n in counts.items())}"


def _compared(found: StudyModes, name: str, number: int) -> tuple[str, str, str]:
    """Return frequency, difference and MAC of the mode of a model that has the shape of a mode of the reference."""
    pair = next((one for one in found.pairs[name] if one.reference == number), None)
    if pair is None:
        return "-", "-", "-"
    frequency = _hertz(found.found[name].frequencies[pair.mode])
    moved = "" if pair.mode == number else f"{pair.mode + 1}: "
    return f"{moved}{frequency}", off_words(pair.difference), f"{pair.mac:.3f}"


def _hertz(frequency: float) -> str:
    return f"{frequency:.6g}"
