"""Comparison of arrays within tolerances, as by `pytest.approx`, which takes 30 us an entry, but as whole arrays."""

from typing import Any

import numpy as np


class near:  # noqa: N801 (it takes the place of pytest.approx)
    """Equal to what differs from `expected` by at most the larger of rel |expected| and abs, everywhere.

    Shapes are the same, unless `expected` is a number, which stands for all entries.
    Defaults are those of `pytest.approx`: rel = 1e-6, or 0 if only `abs` is given, and abs = 1e-12.
    """

    __array_ufunc__ = None  # `array == near(...)` is one truth value
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, expected: Any, rel: float | None = None, abs: float | None = None, nan_ok: bool = False) -> None:
        self.expected = np.asarray(expected)
        self.rel = (1e-6 if abs is None else 0.0) if rel is None else rel
        self.abs = 1e-12 if abs is None else abs
        self.nan_ok = nan_ok

    def __eq__(self, found: object) -> bool:
        values: Any = np.asarray(found)
        if self.expected.ndim and values.shape != self.expected.shape:
            return False
        with np.errstate(invalid="ignore"):
            close = np.abs(values - self.expected) <= np.maximum(self.rel * np.abs(self.expected), self.abs)
        close = (close & np.isfinite(self.expected)) | (values == self.expected)  # infinity is near itself alone
        if self.nan_ok:
            close |= np.isnan(values) & np.isnan(self.expected)
        return bool(close.all())

    def __repr__(self) -> str:
        return f"near({self.expected!r}, rel={self.rel:g}, abs={self.abs:g})"
