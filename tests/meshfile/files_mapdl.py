"""Archives of Ansys Mechanical as it and other programs write them, and a reader of our own, column by column."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import shapes
from files_medit import material, surface
from numpy.typing import NDArray

HEAD = "/COM,ANSYS RELEASE 2026 R1\n/PREP7\n/NOPR\n*IF,_CDRDOFF,EQ,1,THEN\n_CDRDOFF=\n*ENDIF\nDOF,DELETE\n"
TAIL = "MPTEMP,R5.0, 1, 1,  0.00000000    ,\nMPDATA,R5.0, 1,EX  , 1, 1,  1.00000000    ,\n/GO\nFINISH\n"


def fortran(value: float, width: int, digits: int, exponent: int) -> str:
    base, _, power = f"{value:.{digits}E}".partition("E")
    return f"{base}E{power[0]}{int(power[1:]):0{exponent}}".rjust(width)


def nodes(
    points: NDArray[np.float64], integers: int = 3, width: int = 9, real: tuple[int, int, int] = (21, 13, 3)
) -> str:
    """A block, whose lines end with the last coordinate that is not zero."""
    letter = "E" if integers == 3 else "e"
    form = f"({integers}i{width},6{letter.lower()}{real[0]}.{real[1]}" + (f"e{real[2]})" if real[2] > 2 else ")")
    word = "SOLID" if integers == 3 else ""
    lines = [f"NBLOCK,{2 * integers},{word},{len(points):9},{len(points):9}", form]
    for i, point in enumerate(points.tolist(), 1):
        while integers == 3 and point and point[-1] == 0:
            point = point[:-1]
        lines.append(
            "".join(f"{one:{width}}" for one in [i, 0, 0][:integers]) + "".join(fortran(x, *real) for x in point)
        )
    return "\n".join([*lines, "N,R5.3,LOC,       -1," if integers == 3 else "-1", ""])


def elements(listed: Sequence[tuple[int, int, Sequence[int]]], first: int = 1, width: int = 9) -> str:
    """A block of SOLID: material, type and nodes of each."""
    lines = [f"EBLOCK,19,SOLID,{len(listed):9},{len(listed):9}", f"(19i{width})"]
    for i, (mat, kind, row) in enumerate(listed, first):
        words = [f"{one:{width}}" for one in [mat, kind, 1, 1, 0, 0, 0, 0, len(row), 0, i, *row]]
        lines += ["".join(words[:19]), *(["".join(words[19:])] if words[19:] else [])]
    return "\n".join([*lines, f"{-1:{width}}", ""])


def others(listed: Sequence[tuple[int, Sequence[int]]], first: int, kind: int) -> str:
    """A block that is not one of SOLID: material and nodes of each."""
    lines = [f"eblock,10,,,{len(listed)}", "(15i9)"]
    for i, (mat, row) in enumerate(listed, first):
        lines.append("".join(f"{one:9}" for one in [i, kind, kind, mat, 0, *row]))
    return "\n".join([*lines, "-1", ""])


def component(name: str, kind: str, members: Sequence[int]) -> str:
    words = [f"{one:10}" for one in members]
    lines = ["".join(words[at : at + 8]) for at in range(0, len(words), 8)]
    return "\n".join([f"CMBLOCK,{name:8},{kind},{len(members):8}  ! users component", "(8i10)", *lines, ""])


def collapsed(row: Sequence[int]) -> list[int]:
    a, b, c, d = row
    return [a, b, c, c, d, d, d, d]


def solid(path: Path) -> None:
    """Tetrahedra as hexahedra that repeat nodes, in two materials and types; components; some faces."""
    points, cells = shapes.block()
    parts = material(points, cells).tolist()
    listed = [(part, part, collapsed(row)) for part, row in zip(parts, (cells + 1).tolist(), strict=True)]
    skin = surface(cells)
    faces = others([(3, [*row, row[2]]) for row in (skin + 1).tolist()], len(cells) + 1, 3)
    sets = component("SOME", "ELEM", [1, -4, 9]) + component("TIPS", "NODE", [2, 5, -7])
    path.write_text(
        HEAD
        + "ET,1,185\nET,2,SOLID185\n*set,tid,3\n"
        + nodes(points)
        + elements(listed)
        + "et,tid,154\n"
        + faces
        + sets
        + TAIL
    )


def plane(path: Path) -> None:
    """In the plane, without third coordinates; older columns, and lines that end as on Windows."""
    points, cells = shapes.plate()
    listed = [(1, 4, [*row, row[2]]) for row in (cells + 1).tolist()]
    text = "! a plate\n" + HEAD + "ETBLOCK,        1,        1\n(2i9,19a9)\n        4      182        0\n       -1\n"
    text += nodes(points, width=8, real=(16, 9, 2)) + elements(listed, width=8) + TAIL
    path.write_bytes(text.replace("\n", "\r\n").encode())


def workbench(path: Path) -> None:
    points, cells = shapes.block()
    listed = [(1, 1, row) for row in (cells + 1).tolist()]
    text = "/batch\n/prep7\n" + nodes(points, 1, real=(20, 9, 3)).lower() + "/wb,elem,start\net,1,285\n"
    path.write_text(text + elements(listed, width=10).lower() + "/wb,elem,end\n")


def compact(path: Path) -> None:
    points, cells = shapes.block()
    parts, text = material(points, cells), nodes(points, 1, real=(20, 9, 3)).lower()
    for part in (1, 2):
        rows = np.flatnonzero(parts == part)
        lines = ["".join(f"{one:9}" for one in [i + 1, *collapsed(cells[i] + 1)]) for i in rows.tolist()]
        text += f"et,{part},185\nMAT,{part} $ TYPE,{part} $ REAL,1\neblock,9,COMPACT,,{len(rows)}\n(9i9)\n"
        text += "\n".join([*lines, "-1", ""])
    path.write_text("/batch\n/com,a comment\n/prep7\n" + text)


FILES: dict[str, Callable[[Path], None]] = {
    "solid.cdb": solid, "plane.cdb": plane, "ds.dat": workbench, "compact.dat": compact,
}  # fmt: skip
PADDED = set(FILES)


def _columns(line: bytes, form: bytes) -> list[int]:
    """Where the coordinates of a line begin and end."""
    integers, width = (int(one) for one in form[1:].split(b",")[0].split(b"i"))
    real = int(form.split(b",6e")[1].split(b".")[0])
    return [integers * width + real * i for i in range(4) if integers * width + real * i <= len(line.rstrip())]


def fields(data: bytes) -> list[bytes]:
    """The data, in pieces: a coordinate, of all its columns, or what is none; three for each node."""
    found: list[bytes] = []
    form = b""
    for line in data.splitlines(keepends=True):
        if line[:1] in b"N-n" or line.startswith(b"nblock"):
            form = b""
        if form not in (b"", b"?"):
            at = _columns(line, form)
            pieces = [line[a:b] for a, b in pairwise(at)]
            found += [line[: at[0]], *pieces, *[b""] * (3 - len(pieces)), line[at[-1] :]]
            continue
        found.append(line)
        form = b"?" if line.upper().startswith(b"NBLOCK") else line if form == b"?" else form
    assert b"".join(found) == data
    return found


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Points (n, 3), and all other lines."""
    points, rest, form = [], [], b""
    for line in path.read_bytes().splitlines():
        if line[:1] in b"N-n":
            form = b""
        if form not in (b"", b"?"):
            at = _columns(line, form)
            point = [float(line[a:b]) for a, b in pairwise(at)]
            points.append(point + [0.0] * (3 - len(point)))
            rest.append(line[: at[0]])
            continue
        rest.append(line)
        form = b"?" if line.upper().startswith(b"NBLOCK") else line if form == b"?" else form
    return np.array(points), {"rest": rest}
