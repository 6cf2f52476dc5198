"""Read large result files once, from top to bottom: lines with columns of fixed width, and binary values."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedReader
from itertools import islice
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from truespring.arrays import Floats, Ints
from truespring.errors import ReferenceFileError
from truespring.opening import open_file
from truespring.reference.record import Reading

# Number of lines in memory at a time: limits the memory use of reading.
CHUNK = 1 << 12

# Length at which a line is cut; what follows the cut then raises an error.
_LONGEST = 1000

# A number written by "%12.5E", with leading blanks.
_WRITTEN = re.compile(rb" *[+-]?(?:\d+\.\d+E[+-]\d{2,3}|nan|inf)", re.IGNORECASE)

_BLANK = np.isin(np.arange(256), list(b" \r\n"))


class Scan:
    """A file that is being read; `line_number` is the number of the last line read."""

    def __init__(self, file: Path, stream: BufferedReader, reading: Reading | None) -> None:
        self.file = file
        self.line_number = 0
        self._stream, self._reading = stream, reading
        self._size = file.stat().st_size
        self._is_binary = False

    def refuse(self, why: str, line_number: int | None = None) -> NoReturn:
        """Raise ReferenceFileError with the place: byte of a binary file, else line, by default the last one read."""
        where = f"byte {self._stream.tell()}" if self._is_binary else f"line {line_number or self.line_number}"
        raise ReferenceFileError(f"{self.file}: {where}: {why}")

    def line(self) -> bytes:
        """Return the next line with its line end; empty at the end of the file."""
        line = self._stream.readline(_LONGEST)
        self.line_number += 1
        if self.line_number % CHUNK == 0:
            self._tell()
        return line

    def lines(self, count: int) -> list[bytes]:
        """Return the next `count` lines with their line ends; fewer at the end of the file."""
        lines = list(islice(iter(lambda: self._stream.readline(_LONGEST), b""), count))
        self.line_number += len(lines)
        self._tell()
        return lines

    def skip(self, mark: bytes) -> None:
        """Skip lines up to and including the next one that begins with `mark`; raise ReferenceFileError without one."""
        while line := self.line():
            if line.startswith(mark):
                return
        self.refuse(f"the file is truncated: '{mark.decode().strip()}' is expected at the end of a block")

    def values(self, dtype: np.dtype[Any], count: int) -> NDArray[Any]:
        """Return the next binary values, shape (count,), in the file's unit."""
        self._is_binary = True
        data = self._stream.read(dtype.itemsize * count)
        self._tell()
        if len(data) < dtype.itemsize * count:
            self.refuse(f"the file is truncated: {dtype.itemsize * count} bytes are expected, {len(data)} were found")
        return np.frombuffer(data, dtype)

    def is_at(self, *beginnings: bytes) -> bool:
        """Return whether one of `beginnings` or the end of the file follows."""
        place = self._stream.tell()
        following = self._stream.read(max(map(len, beginnings)))
        self._stream.seek(place)
        return not following or following.startswith(beginnings)

    def done(self) -> None:
        """Report that reading is complete."""
        if self._reading:
            self._reading(1.0)

    def _tell(self) -> None:
        if self._reading:
            self._reading(min(self._stream.tell() / max(self._size, 1), 1.0))

    def columns(self, lines: list[bytes], begins: int, *blocks: tuple[int, int, str]) -> list[NDArray[Any]]:
        """Return the numbers in the last lines read, in columns of fixed width.

        Columns need no separator ("-1.00000E+00-2.00000E+00").

        Args:
            lines: the last lines read, of equal length.
            begins: position of the first column.
            blocks: number of columns, width of each, and "int" or "float".

        Returns an array of shape (n_lines, columns) for each block. Raises ReferenceFileError, with the line, if a line
        is not such a row.
        """
        first = self.line_number - len(lines) + 1
        self._refuse_ragged(lines, first)
        table = np.frombuffer(b"".join(lines), np.uint8).reshape(len(lines), -1)
        end = begins + sum(count * width for count, width, _ in blocks)
        wrong = ~_BLANK[table[:, end:]].all(axis=1) | (table == 0).any(axis=1)
        if table.shape[1] < end or wrong.any():
            place = int(wrong.argmax())
            self.refuse(f"{self.shown(lines[place])} is not a row of this block", first + place)
        found = []
        for count, width, kind in blocks:
            fields = np.ascontiguousarray(table[:, begins : begins + count * width]).view(f"S{width}")
            begins += count * width
            found.append(self._converted(fields, kind, first))
        return found

    def glued(self, lines: list[bytes], begins: int, id_width: int, count: int) -> tuple[Ints, Floats]:
        """Return node numbers and values in the last lines read, whose values may exceed their columns.

        On Windows, and for very small numbers, exponents have three digits: negative numbers then exceed their column.
        Numbers with two digits have a leading blank or sign, so that the result is unambiguous.

        Args:
            lines: the last lines read, of any length.
            begins, id_width: position and width of the node number.
            count: number of values that follow it.

        Returns arrays of shapes (n,) and (n, count). Raises ReferenceFileError, with the line, if a line is not such a
        row.
        """
        first = self.line_number - len(lines) + 1
        numbers, values = np.empty(len(lines), dtype=np.int64), np.empty((len(lines), count))
        for place, line in enumerate(lines):
            text = line[begins + id_width :].rstrip()
            found = _WRITTEN.findall(text)
            number = line[begins : begins + id_width].strip()
            if not line.endswith(b"\n"):
                self.refuse(f"{self.shown(line)} has no line end: the file is truncated", first + place)
            if not number.isdigit() or len(found) != count or b"".join(found) != text:
                self.refuse(
                    f"{self.shown(line)} is not a row of this block: expected a node and {count} numbers, with "
                    "exponents of two or three digits; write the results again, in CalculiX also by *NODE OUTPUT",
                    first + place,
                )
            numbers[place], values[place] = int(number), [float(one) for one in found]
        return numbers, values

    def _refuse_ragged(self, lines: list[bytes], first: int) -> None:
        for place, line in enumerate(lines):
            if len(line) != len(lines[0]):
                why = f"{self.shown(line)} is shorter or longer than the row before"
                self.refuse(why + ("" if line.endswith(b"\n") else ": the file is truncated"), first + place)

    def _converted(self, fields: NDArray[Any], kind: str, first: int) -> NDArray[Any]:
        try:
            return fields.astype(np.int64 if kind == "int" else np.float64)
        except (ValueError, OverflowError):
            pass
        numbers = np.empty(fields.shape)  # slower, but finds the row; Fortran omits the E of a long exponent
        for (row, column), field in np.ndenumerate(fields):
            number = _number(field, kind)
            if number is None:
                self.refuse(f"{self.shown(field)} is not a number", first + row)
            numbers[row, column] = number
        return numbers

    @staticmethod
    def shown(text: bytes) -> str:
        """Return a piece of the file for a message, shortened, without unprintable characters."""
        read = text.decode("ascii", errors="replace").strip()
        shown = "".join(letter if letter.isprintable() else "?" for letter in read)
        return f"'{shown}'" if len(shown) <= 60 else f"'{shown[:60]}...'"


def _number(field: bytes, kind: str) -> float | None:
    text = field.decode("latin-1").strip()
    try:
        return int(text) if kind == "int" else float(text)
    except ValueError:
        head, sign, exponent = text[:1], *_exponent(text[1:])
    try:
        return None if kind == "int" else float(f"{head}{sign}E{exponent}")
    except ValueError:
        return None


def _exponent(text: str) -> tuple[str, str]:
    """Split "1.234567-100" into its mantissa and its exponent."""
    place = max(text.rfind("-"), text.rfind("+"))
    return (text[:place], text[place:]) if place > 0 else (text, "")


@contextmanager
def scanning(file: Path, reading: Reading | None) -> Iterator[Scan]:
    """Open a file that passed `refuse_unreadable`."""
    try:
        with open_file(file, ReferenceFileError) as stream:
            yield Scan(file, stream, reading)
    except OSError as error:
        raise ReferenceFileError(f"{file} cannot be read: {error.strerror}") from None
