"""What acts on a terminal is escaped, and nothing else."""

from __future__ import annotations

import os
import sys
import unicodedata

import pytest

from meshfix_cli.report.plain import plain


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("a\x1b[31mb", r"a\x1b[31mb"),
        ("one\ntwo\r\tthree", r"one\ntwo\r\tthree"),
        ("\x00\x07\x7f", r"\x00\x07\x7f"),
        ("\x9b2J", r"\x9b2J"),
        ("a\u202egnp.vtk", r"a\u202egnp.vtk"),
        ("\u2066\u200f\u061c\u2028", r"\u2066\u200f\u061c\u2028"),
        (os.fsdecode(b"\xff.vtk"), r"\xff.vtk"),
        ("\ud800", r"\ud800"),
        ("", ""),
    ],
)
def test_what_acts_on_a_terminal_is_escaped(text: str, shown: str) -> None:
    assert plain(text) == shown


@pytest.mark.parametrize(
    "text", ["m\u00fcnze 30°/mesh.vtk", "C:\\new\\x.vtk", "網格 \u00a0.vtk", "نموذج.vtk", "\U0001f9ca"]
)
def test_what_people_write_stays(text: str) -> None:
    assert plain(text) == text


def test_every_character_can_be_shown_and_encoded() -> None:
    """By what Unicode says of each: controls, surrogates, ends of lines, and what turns the direction of text."""
    for code in range(sys.maxunicode + 1):
        character = chr(code)
        acts = unicodedata.category(character) in ("Cc", "Cs", "Zl", "Zp") or unicodedata.bidirectional(character) in (
            "LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI",
        )  # fmt: skip
        shown = plain(character)
        assert (shown != character) == (acts or code in (0x61C, 0x200E, 0x200F)), hex(code)
        shown.encode()
