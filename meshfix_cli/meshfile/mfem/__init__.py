"""MFEM's .mesh files: sections of elements and of facets of the boundary, a line each, and of vertices, a row each.

A line of an element has its attribute, the number of its type, and its vertices from 0. Where the mesh has nodes, a
grid function tells the coordinates, all x before all y or point by point, and the vertices are only counted.

Source: MFEM documentation, "Mesh formats"; MFEM, "mesh_readers.cpp", "geom.hpp" and "fe_l2.cpp".
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.lagrange import HIGHEST, Kind, key_of
from meshfix_cli.mesh.topology import distinct
from meshfix_cli.meshfile.mfem.nodes import Linear, higher_order, own_nodes
from meshfix_cli.meshfile.source import Cells, Source
from meshfix_cli.meshfile.splice import InPlace, Places
from meshfix_cli.meshfile.tables import Int64, IntegerLines, Numbering, Runs, alike, integer_lines, rows, without
from meshfix_cli.meshfile.text import Spans, in_line, integers

_COMMENT = re.compile(rb"(?m)^[ \t]*#[^\n\r]*")
_BEGIN = re.compile(rb"\s*MFEM (?:(\w+) )?mesh v(\d+\.\d+)[^\n\r]*")
_WORD = re.compile(rb"\s*([A-Za-z_]\w*)(?!\S)")
_SET = re.compile(rb'\s*"([^"\n]*)"')
_SPACE = re.compile(
    rb"\s*FiniteElementSpace\s+FiniteElementCollection:\s*(\S+)\s+VDim:\s*([1-3])\s+Ordering:\s*([01])(?!\S)"
)
# Spaces of functions whose values are those at the nodes. Of the first order those of all H1 are; U and T4: they are
# evenly spaced, and else at the points of Gauss and Lobatto.
_SHARED = re.compile(r"Linear|Quadratic|H1\w*?(?:@.)?_\dD_P1|H1(?:@(?P<even>U)|@G)?_\dD_P(?P<order>[1-9]\d*)")
_APART = re.compile(r"L2_T(?:1|(?P<even>4))_\dD_P(?P<order>[1-9]\d*)")
_KINDS = {"NURBS": "a NURBS mesh", "NC": "a nonconforming mesh (NC)", "INLINE": "a mesh that is to be made (INLINE)"}
_TYPES = {
    0: ("vertex", 1), 1: ("line", 2), 2: ("triangle", 3), 3: ("quad", 4), 4: ("tetra", 4), 5: ("hexahedron", 8),
    6: ("wedge", 6), 7: ("pyramid", 5),
}  # fmt: skip
_VERTEX, _PYRAMID = 0, 7
_ATTRIBUTE = "mfem:attribute"


@dataclass
class _Mesh:
    """The sections of a file.

    Attributes
    ----------
    tables : dict
        Lines of elements and of the boundary.
    sets : dict
        Attributes by the name of their set, of the elements and of the boundary.
    n : int
        Number of vertices.
    points : (k, d, 2) int64 or None
        Spans of the coordinates.
    order : int
        That of the nodes.
    apart : bool
        Each element has points of its own, as in periodic meshes.
    lobatto : bool
        They are at the points of Gauss and Lobatto.
    nodes : list of (str, int64)
        The types and the nodes (m, k) of elements and boundary where these are of higher order, and shared.
    end : int
    """

    tables: dict[str, IntegerLines] = field(default_factory=dict)
    sets: dict[str, dict[str, Int64]] = field(default_factory=dict)
    n: int = 0
    points: Spans | None = None
    order: int = 1
    apart: bool = False
    lobatto: bool = False
    nodes: list[tuple[str, Int64]] = field(default_factory=list)
    end: int = 0


def parse(data: bytes) -> Source:
    """Read vertices, elements and boundary, and of any order the nodes that are where their values say."""
    text = without(data, _COMMENT, b"#")
    mesh = _sections(text)
    if mesh.points is None or "elements" not in mesh.tables:
        raise ReadError("is truncated: it has no vertices, or no elements")
    coordinates, runs = Places.of_text(mesh.points), Runs()
    held = _add_apart(runs, mesh) if mesh.apart else None
    if not mesh.apart:
        _add(runs, mesh)
    untold = ("comments",) * (text is not data) + ("what stands behind its end",) * bool(text[mesh.end :].strip())
    return Source(
        coordinates.read(text), runs.cells, InPlace(data, coordinates, runs.corners), runs.arrays, (_ATTRIBUTE,), held,
        untold,
    )  # fmt: skip


def _sections(text: bytes) -> _Mesh:
    begin = _BEGIN.match(text)
    if begin is None:
        raise ReadError("is not a readable MFEM file: it does not begin with MFEM mesh and a version")
    kind = (begin[1] or b"").decode()
    kind = "NC" if not kind and (begin[2] == b"1.1" or b"vertex_parents" in text) else kind
    if kind:
        raise ReadError(f"is {_KINDS.get(kind, f'a {kind} mesh')} of MFEM, which is not read")
    if begin[2] not in (b"1.0", b"1.2", b"1.3"):
        raise ReadError(f"is of MFEM's version {begin[2].decode()}, which is not read: save it as 1.0")
    mesh, at = _Mesh(), begin.end()
    while match := _WORD.match(text, at):
        name, at = match[1].decode(), match.end()
        if name in ("mfem_mesh_end", "mfem_serial_mesh_end"):
            break
        if name == "nodes":
            at = _read_nodes(mesh, text, at)
            continue
        count, at = _integer(text, at)
        if name == "vertices":
            at = _read_vertices(mesh, text, at, count)
        elif name in ("elements", "boundary"):
            mesh.tables[name] = integer_lines(text, at, count, "element")
            at = mesh.tables[name].end
        elif name in ("attribute_sets", "bdr_attribute_sets"):
            mesh.sets[name], at = _read_sets(text, at, count)
        elif name != "dimension":
            raise in_line(text, match.start(1), f"{name!r} is not known")
    else:
        if text[at:].strip():
            raise in_line(text, len(text) - len(text[at:].lstrip()), "there are more numbers than announced")
    mesh.end = at
    return mesh


def _integer(text: bytes, at: int) -> tuple[int, int]:
    values, end = integers(text, at, 1)
    return int(values[0]), end


def _read_vertices(mesh: _Mesh, text: bytes, at: int, count: int) -> int:
    """Read the vertices; where there are nodes, only their number stands there."""
    mesh.n = count
    if _WORD.match(text, at):
        return at
    d, at = _integer(text, at)
    if d not in (1, 2, 3):
        raise in_line(text, at, f"vertices have {d} coordinates")
    mesh.points, at = rows(text, at, count, d)
    return at


def _read_nodes(mesh: _Mesh, text: bytes, at: int) -> int:
    """Read the grid function of the nodes.

    Raises
    ------
    ReadError
        It is of a space that is not read, stands before the elements, or is of elements without such nodes.
    """
    space = _SPACE.match(text, at)
    if space is None:
        raise in_line(text, at, "the space of the nodes is not readable")
    name = space[1].decode("latin-1")
    kind = _SHARED.fullmatch(name) or _APART.fullmatch(name)
    if kind is None:
        raise ReadError(f"has nodes in the space {name}, which are not read")
    mesh.order = int(kind["order"] or 1 + (name == "Quadratic"))
    if mesh.n > len(text):
        raise ReadError(f"is truncated: {mesh.n:,} rows are announced")
    if mesh.order > HIGHEST:
        raise ReadError(f"has nodes of order {mesh.order}, which are not read")
    mesh.apart, mesh.lobatto = kind.re is _APART, kind["even"] is None and mesh.order > 2
    n, d = (int(_own(mesh).sum()) if mesh.apart else mesh.n), int(space[2])
    if mesh.order > 1 and not mesh.apart:
        if not len(_sizes(mesh)[1]):
            raise ReadError("has no elements")
        cells = _linear(mesh, "elements"), _linear(mesh, "boundary")
        mesh.nodes, n = higher_order(mesh.n, mesh.order, *cells, mesh.lobatto)
    by_component = space[3] == b"0"
    spans, at = rows(text, space.end(), d if by_component else n, n if by_component else d)
    mesh.points = spans.transpose(1, 0, 2) if by_component else spans
    return at


def _own(mesh: _Mesh) -> Int64:
    """Return how many nodes elements (m,) have that have each its own."""
    types, count = _sizes(mesh)[1], np.zeros(len(_TYPES), dtype=np.int64)
    for kind in np.unique(types).tolist():
        if kind in (_VERTEX, _PYRAMID):
            raise ReadError(f"has nodes of its own for each {_TYPES[kind][0]}, which are not read")
        count[kind] = len(own_nodes(_TYPES[kind][0], mesh.order))
    return count[types]


def _read_sets(text: bytes, at: int, count: int) -> tuple[dict[str, Int64], int]:
    sets = {}
    for _ in range(count):
        name = _SET.match(text, at)
        if name is None:
            raise in_line(text, at, "there are fewer sets of attributes than announced")
        size, at = _integer(text, name.end())
        sets[name[1].decode("utf-8", "replace")], at = integers(text, at, size)
    return sets, at


def _sizes(mesh: _Mesh) -> tuple[Int64, Int64]:
    """Return how many vertices elements have (m,), and their types (m,)."""
    if "elements" not in mesh.tables:
        raise ReadError("is truncated or not readable: nodes stand before the elements")
    types = _types(mesh.tables["elements"])
    return np.array([_TYPES[kind][1] for kind in range(len(_TYPES))])[types], types


def _types(table: IntegerLines) -> Int64:
    types = table.integers(1, 2)[:, 0]
    unknown = np.flatnonzero((types < 0) | (types >= len(_TYPES)))
    if len(unknown):
        row = int(unknown[0])
        raise in_line(table.text, table.place(row), f"elements of the type {types[row]} are not known")
    return types


def _add(runs: Runs, mesh: _Mesh) -> None:
    """Add the elements and the facets of the boundary, with their nodes of higher order where there are some."""
    cells = [(section, one) for section in ("elements", "boundary") for one in _linear(mesh, section)]
    of_mesh = iter(mesh.nodes or [(one.key, one.vertices) for _, one in cells])
    for section, one in cells:
        key, nodes = next(of_mesh)
        corners = (
            partial(_refuse_higher, mesh.order)
            if mesh.nodes
            else partial(_corners, mesh.tables[section], nodes.shape[1], one.rows)
        )
        _put(runs, Cells(key, nodes, one.rows if section == "elements" else None), corners, mesh, section, one.rows)


def _linear(mesh: _Mesh, section: str) -> list[Linear]:
    """Return the elements, or the facets of the boundary, by their vertices."""
    if section not in mesh.tables:
        return []
    table, vertices_of = mesh.tables[section], Numbering(np.arange(mesh.n)).points_of
    types, found = _types(table), []
    for here in alike(types):
        key, size = _TYPES[int(types[here[0]])]
        found.append(Linear(key, vertices_of(table.integers(2, 2 + size, here), here), here))
    return found


def _put(runs: Runs, cells: Cells, corners: Callable[[], Places], mesh: _Mesh, section: str, here: Int64) -> None:
    """Add a run with its attributes, and with the sets that have them; those of the boundary are sets in any case."""
    run, attributes = len(runs.cells), mesh.tables[section].integers(0, 1, here)[:, 0]
    runs.add(cells, corners, {_ATTRIBUTE: attributes})
    sets = mesh.sets.get("attribute_sets" if section == "elements" else "bdr_attribute_sets", {})
    if section == "boundary":
        sets = {f"boundary {one}": np.array([one]) for one in distinct(attributes).tolist()} | sets
    for name, values in sets.items():
        runs.put(name, run, np.flatnonzero(np.isin(attributes, values)))


def _add_apart(runs: Runs, mesh: _Mesh) -> NDArray[np.bool_]:
    """Add the elements, which have points of their own; return which of these (n,) are on the boundary."""
    table, (_, types), sizes = mesh.tables["elements"], _sizes(mesh), _own(mesh)
    first = np.cumsum(sizes) - sizes
    outside = _on_boundary(mesh)
    held = np.zeros(int(sizes.sum()), dtype=bool)
    for here in alike(types):
        key, size = _TYPES[int(types[here[0]])]
        points = first[here][:, None] + own_nodes(key, mesh.order)
        name = key if mesh.order == 1 else key_of(Kind(key, mesh.order, True, mesh.lobatto))
        _put(runs, Cells(name, points, here), _refuse, mesh, "elements", here)
        held[points[:, :size]] = np.isin(table.integers(2, 2 + size, here), outside)
    return held


def _on_boundary(mesh: _Mesh) -> Int64:
    """Return the vertices (k,) of the facets of the boundary."""
    if "boundary" not in mesh.tables:
        return np.empty(0, dtype=np.int64)
    table, types = mesh.tables["boundary"], _types(mesh.tables["boundary"])
    facets = [table.integers(2, 2 + _TYPES[int(types[here[0]])][1], here).ravel() for here in alike(types)]
    return np.unique(np.concatenate(facets or [np.empty(0, dtype=np.int64)]))


def _refuse() -> Places:
    raise ReadError("has nodes of its own for each element, which would be those of others if it were renumbered")


def _refuse_higher(order: int) -> Places:
    raise ReadError(
        f"has nodes of order {order}, which are told apart by the order of its elements and of their vertices"
    )


def _corners(table: IntegerLines, size: int, here: Int64) -> Places:
    return Places.of_text(table.columns(2, 2 + size, here), "i8")
