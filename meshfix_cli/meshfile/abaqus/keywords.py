"""The keywords of Abaqus .inp files, and where the data lines of each stand."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.text import Spans

MESH = ("NODE", "ELEMENT", "NSET", "ELSET")

_BLANK = b" \t\xef\xbb\xbf"  # a mark of the order of bytes is a blank as well
_STAR = re.compile(rb"\*[^\n]*")
_CONTINUATION = re.compile(rb"\n\s*[A-Za-z][^\n]*")
_GENERATING = ("NGEN", "NCOPY", "NFILL", "NMAP", "ELGEN", "ELCOPY", "SYSTEM")
# Abaqus takes the beginning of a word for the word; these are the parameters that are looked at.
_PARAMETERS = ("ELSET", "GENERATE", "INPUT", "INSTANCE", "NAME", "NSET", "PART", "SYSTEM", "TYPE")
_NESTED = ("PART", "INSTANCE", "ASSEMBLY", "STEP")


@dataclass(frozen=True, eq=False)
class Block:
    """A keyword and its data lines, which stand behind `begin` and before `end`.

    Attributes
    ----------
    scope : str
        Whose numbers and sets its lines mean: those of a part, of an instance that is not one of a part with nodes of
        its own, or "" for those of the assembly, and of a file without parts.
    """

    keyword: str
    parameters: Mapping[str, str]
    begin: int
    end: int
    scope: str


@dataclass(frozen=True, eq=False)
class Deck:
    """The keywords of a file.

    Attributes
    ----------
    text : bytes
        The file with blanks in the place of comments, so that all else stands where it stood.
    blocks : sequence of Block
    instances : dict
        For each instance the scope of its numbers.
    comments : bool
        Whether the file has any.
    """

    text: bytes
    blocks: Sequence[Block]
    instances: Mapping[str, str]
    comments: bool

    def of(self, *keywords: str) -> Iterator[Block]:
        """Give the blocks of some keywords, in their order."""
        return (block for block in self.blocks if block.keyword in keywords)

    def line_ends(self, block: Block) -> NDArray[np.int64]:
        """Return the offsets of the ends of lines (k,), the first of which is that of the keyword."""
        return np.flatnonzero(self._codes(block) == ord("\n")) + block.begin

    def lines(self, block: Block) -> NDArray[np.int64]:
        """Return the offsets of the data lines (k,)."""
        starts = self.line_ends(block) + 1
        return starts[starts < block.end]

    def words(self, block: Block) -> Spans:
        """Return the spans (n, 2) of all words in the data lines."""
        codes = self._codes(block)
        edges = np.diff((codes > ord(" ")) & (codes != ord(",")), prepend=False, append=False)
        return (np.flatnonzero(edges) + block.begin).reshape(-1, 2)

    def untold(self) -> tuple[str, ...]:
        """Name what is not of the mesh: comments and keywords."""
        keywords = dict.fromkeys(block.keyword for block in self.blocks)
        names = [f"*{keyword}" for keyword in keywords if keyword not in MESH and not keyword.startswith("END")]
        return ("comments",) * self.comments + (f"keywords {', '.join(names)}",) * bool(names)

    @property
    def open_end(self) -> bool:
        """Whether the last line is one of the mesh and does not end, which Abaqus wants: the file may have been cut."""
        cut = self.text[self.text.rfind(b"\n") + 1 :].strip()
        return bool(cut and self.blocks and self.blocks[-1].keyword in MESH)

    @property
    def included_by_steps(self) -> bool:
        """Whether files are included behind where the steps begin."""
        keywords = [block.keyword for block in self.blocks]
        return "STEP" in keywords and "INCLUDE" in keywords[keywords.index("STEP") :]

    @property
    def placed(self) -> bool:
        """Whether an instance is moved to its place in the assembly."""
        return any(self.text[block.begin : block.end].strip() for block in self.of("INSTANCE"))

    def _codes(self, block: Block) -> NDArray[np.uint8]:
        return np.frombuffer(self.text, dtype=np.uint8)[block.begin : block.end]


def read_deck(data: bytes) -> Deck:
    """Find the keywords of a file.

    Raises
    ------
    ReadError
        It is not a file of Abaqus, ends too early, or holds nodes or elements elsewhere than in its data lines.
    """
    if not data.lstrip(_BLANK + b"\r\n").startswith(b"*"):
        raise ReadError("is not an Abaqus file: it does not begin with a keyword")
    starred = [*_starred_lines(data)]
    comments = [(star, end) for _, star, end in starred if data.startswith(b"**", star)]
    text = _blanked(data, comments) if comments else data
    keywords = [line for line in starred if not data.startswith(b"**", line[1])]
    deck = Deck(text, *_blocks(text, keywords), bool(comments))
    for block in deck.blocks:
        if block.keyword in _GENERATING:
            raise ReadError(f"uses *{block.keyword}, which meshfix does not read")
        if block.keyword in MESH and "INPUT" in block.parameters:
            raise ReadError(f"uses *{block.keyword} with INPUT=, which meshfix does not read")
    _check_ends(deck)
    return deck


def _starred_lines(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Find the lines whose first character is a star: where the line, and where the star is, and the end."""
    for match in _STAR.finditer(data):
        line = data.rfind(b"\n", 0, match.start()) + 1
        if not data[line : match.start()].strip(_BLANK):
            yield line, *match.span()


def _blanked(data: bytes, spans: Sequence[tuple[int, int]]) -> bytes:
    text = bytearray(data)
    for begin, end in spans:
        text[begin:end] = b" " * (end - begin)
    return bytes(text)


def _check_ends(deck: Deck) -> None:
    """Find what a file that was cut lacks, as far as it can be told: no number of nodes is announced in it."""
    for keyword in _NESTED:
        if len([*deck.of(keyword)]) > len([*deck.of(f"END {keyword}")]):
            raise ReadError(f"is truncated: there is *{keyword} without *END {keyword}")
    if deck.open_end and len(deck.words(deck.blocks[-1])) == 0:  # the line of the keyword
        raise ReadError("is truncated: its last line does not end")


def _blocks(text: bytes, keywords: Sequence[tuple[int, int, int]]) -> tuple[list[Block], dict[str, str]]:
    """Cut the text at its keywords; return the blocks, and for each instance its scope."""
    blocks: list[Block] = []
    instances: dict[str, str] = {}
    scope, filled = "", set()
    for (_, star, begin), (end, _, _) in zip(keywords, [*keywords[1:], (len(text), 0, 0)], strict=False):
        line = text[star:begin]
        while line.rstrip().endswith(b",") and (more := _CONTINUATION.match(text, begin, end)):
            line, begin = more[0], more.end()
        keyword, parameters = _keyword(text[star:begin].decode("latin-1"))
        name = parameters.get("NAME", "").upper()
        if keyword == "PART":
            scope = f"PART {name}"
        elif keyword == "INSTANCE":
            part = f"PART {parameters.get('PART', '').upper()}"
            scope = instances[name] = part if part in filled else f"INSTANCE {name}"
        elif keyword in ("END PART", "END INSTANCE"):
            scope = ""
        elif keyword == "NODE":
            filled.add(scope)
        blocks.append(Block(keyword, parameters, begin, end, scope))
    return blocks, instances


def _keyword(line: str) -> tuple[str, dict[str, str]]:
    """Return the keyword of a line and its parameters."""
    keyword, *others = line.strip()[1:].split(",")
    pairs = (other.partition("=") for other in others)
    parameters = {_spelled("".join(name.upper().split())): value.strip().strip("\"'") for name, _, value in pairs}
    return " ".join(keyword.upper().split()), parameters


def _spelled(name: str) -> str:
    """Return the parameter that a name of three letters or more begins, or the name."""
    return next((one for one in _PARAMETERS if len(name) > 2 and one.startswith(name)), name)
