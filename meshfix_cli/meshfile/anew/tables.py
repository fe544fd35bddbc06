"""Lines of numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def lines(form: str, *columns: NDArray[Any]) -> bytes:
    """Return a line for each row of some arrays (n,) or (n, k), next to one another.

    `form` is for all values of a row and the end of its line; %r gives the shortest number that reads back.
    """
    values = [one.tolist() for array in columns for one in np.asarray(array).reshape(len(array), -1).T]
    return "".join([form % row for row in zip(*values, strict=True)]).encode()


def form_of(reals: int, integers: int) -> str:
    """Return the form of a line of so many reals, and of integers behind them, with blanks between."""
    return " ".join(["%r"] * reals + ["%d"] * integers) + "\n"
