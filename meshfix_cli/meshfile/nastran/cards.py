"""The cards of a deck by their names, and their fields."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.tables import Int64
from meshfix_cli.meshfile.text import Spans, in_line, not_a_number, unmarked

Integer = TypeVar("Integer", bound=np.integer[Any])

BLANK = np.iinfo(np.int32).min  # an integer that is not there
_OTHER = BLANK + 1  # something else is


class Fields(NamedTuple):
    """The first fields of some cards, without their names.

    Attributes
    ----------
    text : bytes
    at : (k,) int64
        Where the cards begin.
    spans : (f, 2) int64
        Of all fields; -1 where a line does not reach one.
    starts : (k+1,) int64
        The number of the first field of each card, and of all fields.
    widths : (f,) uint8
        How many columns a field has; 0: it stands between commas.
    """

    text: bytes
    at: Int64
    spans: Spans
    starts: Int64
    widths: NDArray[np.uint8]

    def columns(self, first: int, last: int) -> Spans:
        """Return the spans (k, last - first, 2) of some fields of each card, -1 for those that a card has not."""
        if self._all_have(last):
            return self.spans.reshape(-1, last, 2)[:, first:]
        spans = np.full((len(self.at), last - first, 2), -1)
        where, which = self._places(first, last)
        spans[where] = self.spans[which]
        return spans

    def widths_of(self, first: int, last: int) -> NDArray[np.uint8]:
        """Return the columns (k, last - first) of the same."""
        if self._all_have(last):
            return self.widths.reshape(-1, last)[:, first:]
        widths = np.zeros((len(self.at), last - first), dtype=np.uint8)
        where, which = self._places(first, last)
        widths[where] = self.widths[which]
        return widths

    def _all_have(self, count: int) -> bool:
        return bool((np.diff(self.starts) == count).all())

    def _places(self, first: int, last: int) -> tuple[NDArray[np.bool_], Int64]:
        which = self.starts[:-1, None] + np.arange(first, last)
        where = which < self.starts[1:, None]
        return where, which[where]

    def words(self) -> list[list[str]]:
        """Return the text of all fields of each card."""
        found = [self.text[max(begin, 0) : max(end, 0)].decode("latin-1").upper() for begin, end in self.spans.tolist()]
        return [found[begin:end] for begin, end in pairwise(self.starts.tolist())]


def some_of(values: NDArray[Integer], rows: Int64) -> NDArray[Integer]:
    """Return the values of some rows, ascending, without a copy where these follow one another."""
    if len(rows) and rows[-1] - rows[0] == len(rows) - 1:
        return values[rows[0] : rows[-1] + 1]
    return values[rows]


def is_number(word: str) -> bool:
    """Whether a field may be the number of a point."""
    return word.isdecimal() and word.isascii() and len(word) < 19


@dataclass(frozen=True, eq=False)
class Deck:
    """The bulk data of a file.

    Attributes
    ----------
    text : bytes
    names : list of str
        The different names of cards.
    kinds : (n,) int32
        Which of these each card has.
    begin : (n,) int64
        Where the cards begin.
    filled : (n,) int64
        How many fields they have, up to the last that is not blank; -1: what follows continues another.
    labels : (n, 2) int32
    nodes : (n, 4) int32
        Integers in the first fields of their first lines.
    cut : bool
        A section of bulk data begins and does not end.
    """

    text: bytes
    names: list[str]
    kinds: NDArray[np.int32]
    begin: Int64
    filled: Int64
    labels: NDArray[np.int32]
    nodes: NDArray[np.int32]
    cut: bool = False

    @classmethod
    def of(cls, data: bytes) -> Deck:
        """Find the cards; ReadError where there may be others elsewhere, or several meshes."""
        text = unmarked(data)
        names, kinds, begin, filled, labels, nodes = kernels.find_cards(text)
        known = [name.tobytes().rstrip(b"\0").decode("latin-1") for name in names]
        return cls(text, known, kinds, begin, filled, labels, nodes)._bulk()

    def _bulk(self) -> Deck:
        """Return what stands between BEGIN BULK, or the beginning of the file, and ENDDATA."""
        begins = self.where("BEGIN")
        if len(begins) > 1:
            raise ReadError("holds several bulk data sections, and one mesh is read: give each a file of its own")
        first = int(begins[0]) + 1 if len(begins) else 0
        ends = self.where("ENDDATA")
        ended = bool((ends >= first).any())
        last = int(ends[ends >= first][0]) if ended else len(self.begin)
        kinds = self.kinds[first:last]
        there = np.bincount(kinds, minlength=len(self.names))
        names = [name if count else "" for name, count in zip(self.names, there.tolist(), strict=False)]
        here = slice(first, last)
        rows = self.begin[here], self.filled[here], self.labels[here], self.nodes[here]
        deck = Deck(self.text, names, kinds, *rows, cut=first > 0 and not ended)
        for name, what in (("INCLUDE", "includes other files"), ("=", "repeats cards by =")):
            if len(found := deck.where(name)):
                raise in_line(self.text, int(deck.begin[found[0]]), f"{what}, which meshfix does not read")
        return deck

    def where(self, *names: str) -> Int64:
        """Return the numbers of the cards that have one of some names, ascending."""
        chosen = [i for i, name in enumerate(self.names) if name in names]
        if len(chosen) == 1:
            return np.flatnonzero(self.kinds == chosen[0])
        return np.flatnonzero(np.isin(self.kinds, chosen))

    def fields(self, rows: Int64, most: int | None = None, *, whole: bool = False) -> Fields:
        """Find the first fields of some cards, or all; whole: all of their columns, and not only what stands there."""
        at = self._begin(rows)
        return Fields(self.text, at, *kernels.card_fields(self.text, at, most or len(self.text), whole))

    def integers(self, rows: Int64, first: int, last: int, *, texts: bool = False) -> NDArray[Any]:
        """Return the integers (k, last - first) in fields of some cards, `BLANK` where there are none.

        Parameters
        ----------
        texts : bool
            A text ends what there is of a card.
        """
        for heads, begin in ((self.labels, 0), (self.nodes, 2)):
            if begin <= first and last <= begin + heads.shape[1]:
                values = some_of(heads, rows)[:, first - begin : last - begin]
                if not values.size or values.min() > _OTHER or not (values == _OTHER).any():
                    return values
        read, bad = kernels.card_integers(self.text, self._begin(rows), first, last, texts)
        if bad >= 0:
            raise not_a_number(self.text, bad, "an integer")
        return read

    def _begin(self, rows: Int64) -> Int64:
        self.check(
            rows, some_of(self.filled, rows) >= 0, "what follows the card bears the name of what continues another"
        )
        return np.ascontiguousarray(some_of(self.begin, rows))

    def check(self, rows: Int64, good: NDArray[np.bool_], what: str) -> None:
        """Raise ReadError with the line of the first of some cards that is not good."""
        if not good.all():
            raise in_line(self.text, int(self.begin[rows[np.argmin(good)]]), what)

    def system(self, number: int) -> str | None:
        """Return the name of the card that defines a coordinate system."""
        for name in self.names:
            if name.startswith("CORD"):  # CORD1 defines two
                rows = self.where(name)
                found = [self.integers(rows, i, i + 1) for i in (0, 4)[: 1 + (name[4:5] == "1")]]
                if (np.hstack(found) == number).any():
                    return name
        return None
