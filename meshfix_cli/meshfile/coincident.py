"""Points that coincide: several at exactly one place, which cells do not share."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Int64 = NDArray[np.int64]


def first_of_each_place(points: NDArray[np.float64], rows: NDArray[np.integer]) -> Int64:
    """Find which points are copies of others.

    Parameters
    ----------
    points : (n, d) float64
    rows : (k,) int
        The points that are looked at, ascending.

    Returns
    -------
    (n,) int64
        For each point the first at its place, itself where there is no other or where it is not looked at.
    """
    first = np.arange(len(points))
    order = rows[np.lexsort(points[rows].T)]  # which leaves those of one place in their order
    same = (points[order[1:]] == points[order[:-1]]).all(axis=1)
    begin = np.flatnonzero(np.concatenate([[True], ~same]))[: len(order)]
    first[order] = np.repeat(order[begin], np.diff(np.append(begin, len(order))))
    return first


def count(first: Int64) -> tuple[int, int]:
    """Return how many points share a place with others, and how many such places there are."""
    copies = first != np.arange(len(first))
    places = np.zeros(len(first), dtype=bool)
    places[first[copies]] = True
    return int(copies.sum() + places.sum()), int(places.sum())
