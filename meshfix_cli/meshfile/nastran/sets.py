"""What a deck says of points beside the elements: constraints, and coordinate systems that are defined by points.

Source: MSC Software, "MSC Nastran Quick Reference Guide", SPC, SPC1, CORD1R, CORD1C, CORD1S.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from meshfix_cli.meshfile.nastran.cards import Deck, is_number
from meshfix_cli.meshfile.tables import Int64, Numbering


def point_sets(deck: Deck, points: Numbering) -> dict[str, Int64]:
    """Return the rows of the points of each single-point constraint."""
    sets: dict[str, list[Int64]] = {}
    for name in ("SPC", "SPC1"):
        for words in deck.fields(deck.where(name)).words():
            spans = _pairs(words[2:]) if name == "SPC1" else ((word, word) for word in words[1:8:3])
            rows = [points.between(int(a), int(b)) for a, b in spans if is_number(a) and is_number(b)]
            sets.setdefault(f"SPC {words[0] if words else ''}", []).extend(rows)
    return {name: np.unique(np.concatenate(rows)) for name, rows in sets.items() if rows}


def _pairs(words: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Give the first and the last number of each range, `1 THRU 9`, and numbers twice that are none."""
    if len(words) > 2 and words[1] == "THRU":
        yield words[0], words[2]
        return
    yield from zip(words, words, strict=True)


def corners_of_systems(deck: Deck, points: Numbering) -> Int64:
    """Return the rows of the points by which coordinate systems are defined: they turn if these move."""
    rows = deck.where("CORD1R", "CORD1C", "CORD1S")
    numbers = deck.integers(rows, 0, 8)[:, [1, 2, 3, 5, 6, 7]]
    found = points.rows_of(numbers).ravel()
    return found[found >= 0]
