"""Broken files of formats that meshio reads: one sentence says what is wrong, without a word of Python or a library."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from bodies import block, plate
from plain_files import WRITERS, writers
from test_verdicts import write

from meshfix_cli import read
from meshfix_cli.errors import MeshfixError
from meshfix_cli.meshfile.plainly import plainly

OF_CODE = re.compile(
    r"meshio|numpy|np\.|h5py|HDF|NetCDF|unpack|broadcast|reshape|base 10|literal|subscript|iterable|object|index|errno"
    r"|[Ee]rror|Traceback|assert|KeyError|`|\w\(|[\[{]|<class|buffer|dtype",
)


def broken(data: bytes) -> Iterator[bytes]:
    """Cut off, with words for numbers, with other counts, with types that are not known, without its cells."""
    lines = data.split(b"\n")
    yield from (data[: len(data) // 2], data[: len(data) // 8], data[:6], b" ")
    yield from (b"\n".join(lines[:k]) + b"\n" for k in (1, 2, 3, 5))
    yield re.sub(rb"(?<=[\s,>])0\.\d+", b"abc", data, count=3)
    yield re.sub(rb"\b1\b", b"one", data)
    yield re.sub(rb"(?<![\d.])(\d\d+)(?![\d.])", lambda found: b"%d" % (int(found[1]) + 7), data, count=2)
    yield re.sub(
        rb"(?i)\b(?:tetra|tet|tri|ctetra|ctria3|volumeelements|tet4|tria3|triangle|tetrahedron)\b", b"GLOVE", data
    )
    yield re.sub(rb"(?m)\S+$", b"", data)


@pytest.mark.parametrize("name", [name for name in WRITERS if name.startswith("through.")])
def test_what_is_wrong_is_said_in_a_sentence(name: str, tmp_path: Path) -> None:
    random, path, refused = np.random.default_rng(1), tmp_path / name, 0
    write(block(random) if name in writers(3, False) else plate(random), path)
    sound = path.read_bytes()
    for data in broken(sound):
        path.write_bytes(data)
        try:
            read(path)
        except MeshfixError as error:
            said, refused = str(error).removeprefix(f"{path}: "), refused + 1
            assert said != str(error)
            assert not OF_CODE.search(re.sub(r"(?:vertices|edge|triangle) \[[\d, -]+\]", "", said)), said
            assert "\n" not in said
            assert len(said) < 300
    assert refused >= 5


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (ValueError("invalid literal for int() with base 10: 'GLOVE'"), "'GLOVE' stands where a number should"),
        (ValueError("could not convert string to float: np.str_('x')"), "'x' stands where a number should"),
        (ValueError("cannot reshape array of size 3 into shape (4,)"), "fewer or other numbers"),
        (ValueError("not enough values to unpack (expected 3, got 1)"), "ends too early"),
        (KeyError("Unable to open object (object 'GRO' doesn't exist)"), "it has no GRO"),
        (KeyError("TET"), "'TET' in it is not known"),
        (OSError(2, "No such file"), "a file that it names is missing"),
        (OSError("Unable to open file (file signature not found)"), "damaged"),
        (TypeError("cannot unpack non-iterable CellBlock object"), "not laid out as it should be"),
        (ModuleNotFoundError("No module named 'h5py'", name="h5py"), "needs the package h5py"),
    ],
)
def test_words_of_libraries_are_turned_into_those_of_files(error: Exception, words: str) -> None:
    assert words in plainly(error)


def test_what_was_said_to_people_is_kept() -> None:
    printed = "Can only read triangular faces\nError: Couldn't read file /a/b.off as off\n"
    assert plainly(SystemExit(1), printed) == "Can only read triangular faces"
    assert "OFF" in plainly(SystemExit(1), "Expected the first line to be `OFF`.\nError: Couldn't read file")
    assert plainly(SystemExit(1), "got np.int64(3)") == "it is not laid out as it should be"


def test_what_cannot_be_written_is_not_called_damaged() -> None:
    for error in (OSError("unable to truncate a file"), IndexError("list index out of range"), TypeError("np.int64")):
        assert plainly(error, otherwise="it does not take this") == "it does not take this"
    assert plainly(SystemExit(1), "Can only write triangles", "it does not take this") == "Can only write triangles"


def test_dolfin_has_as_many_cells_as_it_announces(tmp_path: Path) -> None:
    path = tmp_path / "through.xml"
    write(plate(np.random.default_rng(1)), path)
    sound = path.read_text()
    for what in ("vertices", "cells"):
        path.write_text(re.sub(f'(?<=<{what} size=")', "1", sound))
        with pytest.raises(MeshfixError, match=f"announces .* {what} and holds"):
            read(path)
