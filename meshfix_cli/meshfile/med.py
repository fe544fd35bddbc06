"""MED files, of Salome and Code_Aster: coordinates and vertices stand in data sets of HDF5, component by component.

Each node and cell belongs to one family, and each family to some groups: cells of one family are a region, and groups
are sets. Fields and all else stay in the file. The nodes of solid elements stand in the mirror image of the order of
the table of elements.

Source: EDF and CEA, "MED: modele d'echange de donnees", version 4.1, the reference elements and the model of a mesh.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.meshfile import hdf5
from meshfix_cli.meshfile.hdf5 import Table
from meshfix_cli.meshfile.source import Arrays, Cells, Source, regions_among

CELLS, POINTS = "cell_tags", "point_tags"  # what meshio calls the numbers of families
_TYPES = {
    "PO1": "vertex", "SE2": "line", "SE3": "line3", "SE4": "line4", "TR3": "triangle", "TR6": "triangle6",
    "TR7": "triangle7", "QU4": "quad", "QU8": "quad8", "QU9": "quad9", "TE4": "tetra", "T10": "tetra10",
    "PY5": "pyramid", "P13": "pyramid13", "PE6": "wedge", "P15": "wedge15", "P18": "wedge18", "HE8": "hexahedron",
    "H20": "hexahedron20", "H27": "hexahedron27",
}  # fmt: skip
_PRISM, _BOX = (0, 2, 1, 3, 5, 4), (0, 3, 2, 1, 4, 7, 6, 5)
_PRISM_15 = (*_PRISM, 8, 7, 6, 11, 10, 9, 12, 14, 13)
_BOX_20 = (*_BOX, 11, 10, 9, 8, 15, 14, 13, 12, 16, 19, 18, 17)
# Which of the nodes of the file stands in each place of the table of elements.
ORDER: Mapping[str, Sequence[int]] = {
    "tetra": (0, 2, 1, 3),
    "tetra10": (0, 2, 1, 3, 6, 5, 4, 7, 9, 8),
    "pyramid": (0, 3, 2, 1, 4),
    "pyramid13": (0, 3, 2, 1, 4, 8, 7, 6, 5, 9, 12, 11, 10),
    "wedge": _PRISM,
    "wedge15": _PRISM_15,
    "wedge18": (*_PRISM_15, 17, 16, 15),
    "hexahedron": _BOX,
    "hexahedron20": _BOX_20,
    "hexahedron27": (*_BOX_20, 21, 23, 24, 22, 20, 25, 26),
}
_WITHIN = ("MAI", "FAC", "ARE")  # cells; faces and edges, where cells are described by these
_WHOLE = "MED_NO_PROFILE_INTERNAL"  # what stands for all cells of a type
# Polygons and polyhedra: where the data sets say that each begins, the inner one last.
_OF_ANY = {"POG": ("polygon", ("INN",)), "PO2": ("polygon2", ("INN",)), "POE": ("polyhedron", ("INN", "IFN"))}


class _Run(NamedTuple):
    """Cells of one type as the file holds them: their group, how many they are, and how many nodes each has."""

    group: str
    key: str
    cells: int
    nodes: int

    @property
    def order(self) -> Sequence[int]:
        return ORDER.get(self.key, range(self.nodes))

    def corners(self) -> Table:
        """Where their vertices stand."""
        table = Table.by_column([f"{self.group}/NOD"], self.cells, self.nodes)
        return Table(table.sets, table.at[:, self.order])


def parse(data: bytes) -> Source:
    """Read the one mesh of a file."""
    with hdf5.opened(data, "med") as root:
        name, mesh = _mesh(root)
        nodes = hdf5.group(mesh, "NOE")
        points = _points(nodes)
        found = [_cells(one) for within in _WITHIN for one in _groups(mesh, within).values()]
        runs, cells = [run for run, _ in found], [some for _, some in found]
        layout = hdf5.layout(root, data, "med", points, [run.corners for run in runs])
        load = partial(_arrays, data, name, nodes.name, runs, len(points.at))
        fields = [field for field, kinds in _fields(root, name).items() if any(kind != "NOE" for kind in kinds)]
        tags = [CELLS] if _with_families(root, runs) else []
        regions = regions_among([*tags, *fields])
        given = hdf5.data_set(nodes, "NUM")
        numbers = None if given is None else _per(given, len(points.at))
        untold = _untold(root, name)
        return Source(points.read(root), cells, layout, load, regions, untold=untold, numbers=lambda: numbers)


def _mesh(root: Any) -> tuple[str, Any]:
    """Return the name of the one mesh, and the group of the one step that has its points."""
    meshes = _groups(root, "ENS_MAA")
    if not meshes:
        raise ReadError("is not a readable med file: there is no mesh in it")
    if len(meshes) > 1:
        raise _several("meshes", meshes)
    (name, mesh) = next(iter(meshes.items()))
    if hdf5.attribute(mesh, "TYP", 0) == 1:
        raise ReadError("holds a structured mesh, which meshfix does not read from med files")
    # Before version 3 a mesh had no steps.
    steps = {step: one for step, one in {".": mesh, **hdf5.groups(mesh)}.items() if hdf5.group(one, "NOE") is not None}
    if len(steps) != 1:
        raise _several("steps of its mesh", steps) if steps else ReadError("its mesh has no points")
    return name, next(iter(steps.values()))


def _several(what: str, names: Mapping[str, Any]) -> ReadError:
    listed = ", ".join(hdf5.printable(name) for name in names)
    return ReadError(f"holds several {what} ({listed}), and one mesh is read: give each a file of its own")


def _groups(parent: Any, path: str) -> dict[str, Any]:
    """Return the groups in a group, which need not be there."""
    found = hdf5.group(parent, path)
    return {} if found is None else hdf5.groups(found)


def _points(nodes: Any) -> Table:
    coordinates = hdf5.data_set(nodes, "COO")
    if coordinates is None:
        raise ReadError("is not a readable med file: its mesh has no coordinates")
    n = _number(coordinates, "NBR")
    dimension = coordinates.size // n if n else 3
    if n * dimension != coordinates.size:
        raise _size(coordinates, n)
    return Table.by_column([coordinates.name], n, dimension)


def _number(owner: Any, name: str) -> int:
    value = hdf5.attribute(owner, name)
    if not isinstance(value, int) or value < 0:
        raise ReadError(f"is not a readable med file: the {name} of its {hdf5.name_of(owner)} is {value!r}")
    return value


def _size(found: Any, number: int) -> ReadError:
    return ReadError(f"is not a readable med file: its {hdf5.name_of(found)} has {found.size:,} numbers for {number:,}")


def _cells(group: Any) -> tuple[_Run, Cells]:
    """Read the cells of a type."""
    kind = group.name.rpartition("/")[2]
    connectivity = hdf5.data_set(group, "NOD")
    if connectivity is None:
        raise ReadError(f"its cells {kind!r} are not described by their nodes, which meshfix does not read")
    vertices: Any
    if kind in _OF_ANY:
        key, indices = _OF_ANY[kind]
        vertices = _of_any(group, indices, hdf5.numbers(connectivity, "iu").ravel() - 1)
        run = _Run(group.name, key, len(vertices), 0)
    else:
        count = _number(connectivity, "NBR")
        key = _TYPES.get(kind, kind)
        nodes = ELEMENTS[key].nodes if kind in _TYPES else connectivity.size // max(count, 1)
        if count * nodes != connectivity.size:
            raise _size(connectivity, count)
        run = _Run(group.name, key, count, nodes)
        columns = hdf5.numbers(connectivity, "iu").reshape(nodes, count)
        vertices = np.empty((count, nodes), dtype=columns.dtype)
        for place, here in enumerate(run.order):
            np.subtract(columns[here], 1, out=vertices[:, place])
    ids = hdf5.data_set(group, "NUM")
    return run, Cells(key, vertices, None if ids is None else _per(ids, len(vertices)))


def _of_any(group: Any, indices: Sequence[str], nodes: NDArray[Any]) -> list[NDArray[Any]]:
    """Split the nodes into those of each polygon or polyhedron."""
    starts = None
    for name in reversed(indices):
        found = hdf5.data_set(group, name)
        first = np.ones(1, dtype=np.int64) if found is None else hdf5.numbers(found, "iu").ravel()
        total = len(nodes) if starts is None else len(starts) - 1
        if not len(first) or first[0] != 1 or first[-1] != total + 1 or (np.diff(first) < 0).any():
            raise ReadError(f"is not a readable med file: the {name} of its {hdf5.name_of(group)} is damaged")
        starts = first - 1 if starts is None else starts[first - 1]
    return np.split(nodes, starts[1:-1]) if starts is not None and len(starts) > 1 else []


def _per(found: Any, count: int) -> NDArray[np.int64]:
    """Return a number for each cell or point."""
    values = hdf5.numbers(found, "iu").ravel().astype(np.int64, copy=False)
    if len(values) != count:
        raise _size(found, count)
    return values


def _families(group: Any, count: int) -> NDArray[np.int64]:
    """Return the family of each cell or point; 0 is that of those that are in none."""
    found = hdf5.data_set(group, "FAM")
    return np.zeros(count, dtype=np.int64) if found is None else _per(found, count)


def _arrays(data: bytes, name: str, nodes: str, runs: Sequence[_Run], n: int) -> Arrays:
    with hdf5.opened(data, "med") as root:
        of_cells = [_families(hdf5.group(root, run.group), run.cells) for run in runs]
        cell_tags = {CELLS: of_cells} if _with_families(root, runs) else {}
        of_points = _families(hdf5.group(root, nodes), n)
        named = list(_named(root, name))
        fields = _fields(root, name)
        point, cell = _at_points(fields, n), _in_cells(fields, runs)
    groups: dict[str, list[int]] = {}
    for number, titles in named:
        for title in titles:
            groups.setdefault(title, []).append(number)
    point_sets = {title: rows for title, (rows,) in _members([of_points], groups, 1).items()}
    cell_sets = _members(of_cells, groups, -1)
    point_tags = {POINTS: of_points} if of_points.any() else {}
    return Arrays({**point_tags, **point}, {**cell_tags, **cell}, point_sets=point_sets, cell_sets=cell_sets)


def _members(
    families: Sequence[NDArray[np.int64]], groups: Mapping[str, Sequence[int]], sign: int
) -> dict[str, list[NDArray[np.int64]]]:
    """Return the rows in each run of the members of each group that has families of a sign."""
    mine = {title: numbers for title, numbers in groups.items() if any(sign * number > 0 for number in numbers)}
    found = [np.unique(one, return_inverse=True) for one in families] if mine else []
    return {
        title: [np.flatnonzero(np.isin(kinds, numbers)[which.reshape(-1)]) for kinds, which in found]
        for title, numbers in mine.items()
    }


def _with_families(root: Any, runs: Sequence[_Run]) -> bool:
    return any(hdf5.data_set(root, f"{run.group}/FAM") is not None for run in runs)


def _named(root: Any, mesh: str) -> Iterator[tuple[int, list[str]]]:
    """Give the number of each family, above 0 for points and below for cells, and the names of its groups."""
    inside = [one for path in (f"FAS/{mesh}", f"ENS_MAA/{mesh}/FAS") for one in _groups(root, path).values()]
    for family in [*inside, *(one for kind in inside for one in hdf5.groups(kind).values())]:
        number, found = hdf5.attribute(family, "NUM"), hdf5.data_set(family, "GRO/NOM")
        if isinstance(number, int) and found is not None and found.size and not found.dtype.hasobject:
            raw = np.asarray(found[()]).tobytes()
            size = len(raw) // found.shape[0] if found.shape else len(raw)
            texts = (raw[at : at + size].split(b"\0")[0] for at in range(0, len(raw), size))
            yield number, [text.decode("utf-8", "replace").strip() for text in texts]


def _fields(root: Any, mesh: str) -> dict[str, dict[str, Any]]:
    """Return for each field of the mesh of which there is one step the data set of its values on each kind of cells.

    Values on a part of the cells only are left in the file.
    """
    found = {}
    for name, field in _groups(root, "CHA").items():
        steps = list(hdf5.groups(field).values())
        if str(hdf5.attribute(field, "MAI", mesh)).strip() == mesh and len(steps) == 1:
            sets = {kind: hdf5.data_set(one, f"{_WHOLE}/CO") for kind, one in hdf5.groups(steps[0]).items()}
            found[name] = {kind: values for kind, values in sets.items() if values is not None}
    return found


def _at_points(fields: Mapping[str, Mapping[str, Any]], n: int) -> dict[str, NDArray[Any]]:
    on_nodes = {name: _components(kinds["NOE"], n) for name, kinds in fields.items() if "NOE" in kinds}
    return {name: _flat(values) for name, values in on_nodes.items() if values is not None}


def _in_cells(fields: Mapping[str, Mapping[str, Any]], runs: Sequence[_Run]) -> dict[str, list[NDArray[Any]]]:
    """Return the values of fields in each run, which are not numbers where a field has none."""
    found = {}
    for name, kinds in fields.items():
        sets = [kinds.get("MAI." + run.group.rpartition("/")[2]) for run in runs]
        parts = [None if one is None else _components(one, run.cells) for one, run in zip(sets, runs, strict=True)]
        widths = {part.shape[1] for part in parts if part is not None}
        if len(widths) == 1:
            none = np.full((1, widths.pop()), np.nan)
            whole = (none.repeat(run.cells, 0) if part is None else part for part, run in zip(parts, runs, strict=True))
            found[name] = [_flat(part) for part in whole]
    return found


def _components(found: Any, count: int) -> NDArray[Any] | None:
    """Return the components (count, k) of a field; None: the data set has others."""
    if found.dtype.kind not in "iuf" or not count or not found.size or found.size % count:
        return None
    return hdf5.numbers(found, "iuf").reshape(-1, count).T


def _flat(values: NDArray[Any]) -> NDArray[Any]:
    return values[:, 0] if values.shape[1] == 1 else values


def _untold(root: Any, name: str) -> tuple[str, ...]:
    """Name the fields that are not among the arrays."""
    others = [field for field in _groups(root, "CHA") if not _fields(root, name).get(field)]
    return (f"fields {', '.join(others)}",) if others else ()
