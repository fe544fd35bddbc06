"""Nastran's bulk data: points in columns of 16, elements in those of 8, each with the number of its property.

Source: MSC Software, "MSC Nastran Quick Reference Guide", sections "Format of Bulk Data Entries" and "Bulk Data
Entries".
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

import numpy as np

from meshfix_cli import kernels
from meshfix_cli.errors import WriteError
from meshfix_cli.mesh.elements import dimension_of
from meshfix_cli.meshfile.anew.content import Content, Int64
from meshfix_cli.meshfile.anew.gmsh_groups import groups_of
from meshfix_cli.meshfile.anew.tables import beside, in_columns
from meshfix_cli.meshfile.nastran.elements import ORDER
from meshfix_cli.meshfile.recognise import Format

HELD = {
    "line": "CROD", "line3": "CBEAM3", "triangle": "CTRIA3", "triangle6": "CTRIA6", "quad": "CQUAD4", "quad8": "CQUAD8",
    "quad9": "CQUAD", "tetra": "CTETRA", "tetra10": "CTETRA", "pyramid": "CPYRAM", "pyramid13": "CPYRAM",
    "wedge": "CPENTA", "wedge15": "CPENTA", "hexahedron": "CHEXA", "hexahedron20": "CHEXA",
}  # fmt: skip
MOST = 10**8 - 1  # of 8 columns


def written(content: Content, _: Format) -> bytes:
    """Return a deck; properties are the materials, and sets of elements that have none."""
    kept = [i for i, run in enumerate(content.cells) if run.type in HELD and len(run.vertices)]
    if max(len(content.points), sum(len(content.cells[i].vertices) for i in kept)) > MOST:
        raise WriteError("cannot be written as nastran: numbers have 8 digits, and there are too many")
    # gmsh takes what stands behind a wedge for more nodes of it, but for other elements.
    parts = [b"CEND\nBEGIN BULK\n", _points(content), *_constraints(content)]
    for i, properties in zip(kept, _properties(content, kept), strict=True):
        run = content.cells[i]
        order = np.argsort(ORDER[run.type]) if run.type in ORDER else slice(None)
        table = np.column_stack([content.elements[i], properties, content.nodes_of(run.vertices[:, order])])
        parts.append(in_columns(f"{HELD[run.type]:8}", table, 8, 8, "+       "))
    return b"".join([*parts, b"ENDDATA\n"])


def _points(content: Content) -> bytes:
    """Return a GRID for each point, of two lines."""
    points = np.nan_to_num(content.in_space(), posinf=0.0, neginf=0.0)  # those of no element may be anything
    n = len(points)
    fields = np.frombuffer(kernels.write_fields(points.ravel(), 16, True)[0], dtype=np.uint8).reshape(n, 48)
    numbers = in_columns("GRID*   ", content.nodes[:, None], 16, 4, "")
    head, first = np.frombuffer(numbers, dtype=np.uint8).reshape(n, 25)[:, :24], fields[:, :32]
    blank, begin, end = (np.frombuffer(text, dtype=np.uint8) for text in (b" " * 16, b"\n*       ", b"\n"))
    return beside(head, blank, first, begin, fields[:, 32:], end)


def _properties(content: Content, kept: Sequence[int]) -> list[Int64]:
    """Return the number of the property of each element: that of its group, if no element of more dimensions has it."""
    groups = groups_of(content, several=False).physical
    used = {i: np.unique(groups[i]).tolist() for i in kept}
    free = max([0, *(number for mine in used.values() for number in mine if number <= MOST - len(used))]) + 1
    taken: dict[int, int] = {}
    new: dict[tuple[int, int], int] = {}
    for i in sorted(kept, key=lambda i: -dimension_of(content.cells[i].type)):
        dimension = dimension_of(content.cells[i].type)
        for number in used[i]:
            whole = 0 < number <= MOST and taken.setdefault(number, dimension) == dimension
            if not whole and (dimension, number) not in new:
                new[dimension, number], free = free, free + 1
    found = []
    for i in kept:
        known = [new.get((dimension_of(content.cells[i].type), number), number) for number in used[i]]
        found.append(np.array(known, dtype=np.int64)[np.searchsorted(used[i], groups[i])])
    return found


def _constraints(content: Content) -> Iterator[bytes]:
    """Give sets of points as single-point constraints, which no subcase asks for; they have a number for a name."""
    own = {name: int(match[1]) for name in content.point_sets if (match := re.fullmatch(r"SPC (\d{1,8})", name))}
    free = max([0, *own.values()])
    for name, rows in content.point_sets.items():
        free += name not in own
        number = own.get(name, free)
        cards = content.nodes[rows]
        whole = len(cards) // 6 * 6
        for some in (cards[:whole].reshape(-1, 6), cards[None, whole:]):
            if some.size:
                about = np.broadcast_to([number, 123456], (len(some), 2))
                yield in_columns("SPC1    ", np.hstack([about, some]), 8, 8, "+       ")
