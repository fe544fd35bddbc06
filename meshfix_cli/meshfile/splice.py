"""Writing by splicing: only the coordinates that moved are replaced in the original bytes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Span = tuple[int, int, int, int, int, int]  # start and end of x, y and z


@dataclass(frozen=True, eq=False)
class Places:
    """Where a file holds its coordinates, point by point in the file's order.

    Attributes
    ----------
    start : (n, 3) int64
        Offset of the first byte of each coordinate.
    end : (n, 3) int64 or None
        Offset behind the text of each coordinate; None for binary numbers.
    dtype : numpy dtype
        Type of the numbers, with its byte order where they are binary.
    """

    start: NDArray[np.int64]
    end: NDArray[np.int64] | None
    dtype: np.dtype[Any]


def splice(
    data: bytes, places: Places, original: NDArray[np.floating[Any]], points: NDArray[np.floating[Any]]
) -> bytes | None:
    """Return the file with other coordinates; what did not change keeps its characters.

    Text is the shortest that reads back to the same number of the file's type.

    Parameters
    ----------
    original, points : (n, 3) float
        As the file was read, and as it shall read.

    Returns
    -------
    bytes or None
        None where the places do not hold the original coordinates.
    """
    if len(places.start) != len(points) or points.shape[1] != 3:
        return None
    rows, columns = np.nonzero((points != original) & ~np.isnan(points))
    begin, dtype = places.start[rows, columns], places.dtype
    old, new = original[rows, columns].astype(dtype), points[rows, columns].astype(dtype)
    if places.end is None:
        cells = begin[:, None] + np.arange(dtype.itemsize)
        buffer = np.frombuffer(data, dtype=np.uint8).copy()
        if not np.array_equal(buffer[cells].copy().view(dtype).ravel(), old):
            return None
        buffer[cells] = new.view(np.uint8).reshape(cells.shape)
        return buffer.tobytes()
    pieces, done = [], 0
    for first, last, was, now in zip(begin.tolist(), places.end[rows, columns].tolist(), old, new, strict=True):
        if dtype.type(data[first:last]) != was:
            return None
        pieces += [data[done:first], str(now).encode()]
        done = last
    return b"".join([*pieces, data[done:]])


def text_places(spans: Sequence[Span], dtype: str) -> Places:
    """Build places of text numbers from the span of each point."""
    table = np.array(spans, dtype=np.int64).reshape(-1, 3, 2)
    return Places(table[:, :, 0], table[:, :, 1], np.dtype(dtype))


def binary_places(first: NDArray[np.int64], dtype: str) -> Places:
    """Build places of binary points, three numbers in a row, from the offset of each point."""
    kind = np.dtype(dtype)
    return Places(first[:, None] + kind.itemsize * np.arange(3), None, kind)
