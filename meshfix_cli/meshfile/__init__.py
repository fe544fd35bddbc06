"""Path or stream <-> Mesh. The only importer of meshio."""

from __future__ import annotations

import os
import struct
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import InvalidMeshError, MeshfixError, ReadError, WriteError
from meshfix_cli.mesh import CELL_NAMES, LARGEST_COORDINATE, Mesh, Topology
from meshfix_cli.meshfile import formats, gmsh, obj, vtk
from meshfix_cli.meshfile.atomic import check_target, write_file
from meshfix_cli.meshfile.formats import Format
from meshfix_cli.meshfile.plane import plane_basis
from meshfix_cli.meshfile.splice import splice
from meshfix_cli.meshfile.through_meshio import SIMPLEX, read_bytes, read_path, simplices_of, write_path

__all__ = ["Document", "check_target", "output_format", "read", "write"]

REGION_ARRAYS = ("gmsh:physical", "medit:ref", "cell_tags")
SPLICED = {"gmsh": gmsh.find_coordinates, "obj": obj.find_coordinates, "vtk": vtk.find_coordinates}


@dataclass(frozen=True, eq=False)
class Document:
    """A mesh as it came from a file, and all that is needed to write it back.

    Attributes
    ----------
    name : str
        The path, or "<stdin>".
    mesh : Mesh
    format : Format
    ids : (m,) int64
        For each simplex of the mesh its position among all cells of the file, from 0.
    fixed : dict
        Number of vertices held for each reason; a vertex counts for the first that applies.
    notes : tuple of str
        What a user should know about the file, a sentence each.
    source : meshio.Mesh
    data : bytes
        The file.
    basis : (2, 3) float64 or None
        Spans the plane of a planar mesh in space.
    """

    name: str
    mesh: Mesh
    format: Format
    ids: NDArray[np.int64]
    fixed: dict[str, int]
    notes: tuple[str, ...]
    source: Any = field(repr=False)
    data: bytes = field(repr=False)
    basis: NDArray[np.float64] | None

    def file_points(self, mesh: Mesh) -> NDArray[np.floating[Any]]:
        """Return the points of a moved mesh as the file holds them: shape, type and the bits of fixed vertices."""
        original = self.source.points
        if original.dtype.kind != "f":
            original = original.astype(np.float64)
        points: NDArray[np.floating[Any]] = original.copy()
        moved = (mesh.points != self.mesh.points).any(axis=1) & mesh.topology.used
        with np.errstate(over="ignore"):  # `in_plane` tells when float32 overflows
            if self.basis is None:
                points[moved] = mesh.points[moved]
            elif np.isin(self.basis, (0.0, 1.0)).all():
                points[np.ix_(moved, self.basis.argmax(axis=1))] = mesh.points[moved]
            else:
                points[moved] = original[moved] + (mesh.points[moved] - self.mesh.points[moved]) @ self.basis
        return points

    def as_stored(self, mesh: Mesh) -> Mesh:
        """Return a moved mesh with the coordinates rounded as the file will hold them."""
        return self.in_plane(self.file_points(mesh).astype(np.float64), mesh)

    def in_plane(self, points: NDArray[np.float64], mesh: Mesh) -> Mesh:
        """Return a moved mesh at points (n, 2 or 3) in the coordinates of the file."""
        used = points[mesh.topology.used]
        if not (np.abs(used) <= LARGEST_COORDINATE).all():
            raise InvalidMeshError("the coordinates are too large for the numbers of the file")
        return mesh.with_points(np.ascontiguousarray(points if self.basis is None else points @ self.basis.T))

    def first_valid_as_stored(self, *meshes: Mesh) -> Mesh:
        """Return the first of some moved meshes that is valid as the file stores it, else the best."""
        ranked = []
        for mesh in meshes:
            inverted, smallest = self.as_stored(mesh).check()
            if inverted == 0:
                return mesh
            ranked.append(((inverted, -smallest), mesh))
        return min(ranked, key=lambda pair: pair[0])[1]

    def is_kept_by(self, form: Format) -> bool:
        """Whether writing in a format keeps all but the coordinates, byte for byte."""
        return form == self.format and form.reader in SPLICED


def read(path: str | os.PathLike[str], fix: str | None = None, regions: str | None = None) -> Document:
    """Read a triangle or tetrahedral mesh.

    Parameters
    ----------
    path : str or path
        "-" reads stdin.
    fix : str, optional
        Name of a point-data array; vertices where it is not zero are held.
    regions : str, optional
        Name of a cell-data array; the interface between regions is held. Default: those of `REGION_ARRAYS`.

    Raises
    ------
    ReadError
        The file cannot be read, holds no mesh of simplices, or not the arrays named.
    InvalidMeshError
        See `Mesh.build`.
    """
    streamed = os.fspath(path) == "-"
    name = "<stdin>" if streamed else os.fspath(path)
    try:
        data = _read_bytes(None if streamed else Path(name))
        form = formats.sniff(data[: formats.HEAD]) or formats.by_name(Path(name))
        if form is None:
            raise ReadError("the format is not recognised")
        if form.name == "ply" and b"end_header" not in data:  # meshio would read for ever
            raise ReadError("is truncated: its header does not end")
        # A pipe with a name can be read only once, as stdin can.
        source = read_bytes(data, form) if streamed or not Path(name).is_file() else read_path(Path(name), form)
        return _document(name, source, data, form, fix, regions)
    except MeshfixError as error:
        text = str(error)
        raise type(error)(text if text.startswith(name) else f"{name}: {text}") from error


def write(document: Document, mesh: Mesh, target: str | os.PathLike[str], form: Format | None = None) -> Mesh:
    """Write a moved mesh; return it as the file holds it.

    In the format it came in, every byte outside the coordinates that moved stays as it was where the format is
    one of `SPLICED`; otherwise meshio writes what it knows of the document.

    Parameters
    ----------
    document : Document
    mesh : Mesh
        Made of `document.mesh` by moving vertices.
    target : str or path
        Replaced at once or not at all; "-" writes to stdout.
    form : Format, optional
        Default: see `output_format`.

    Returns
    -------
    Mesh
        With the coordinates rounded as the format rounds them.

    Raises
    ------
    WriteError
        Nothing was written.
    """
    target = os.fspath(target)
    form = form or output_format(document, target)
    check_target(target)
    points = document.file_points(mesh)
    spliced = _splice(document, points) if document.is_kept_by(form) else None
    stored = document.in_plane(points.astype(np.float64), mesh)

    def produce(temporary: Path) -> None:
        nonlocal stored
        if spliced is not None:
            temporary.write_bytes(spliced)
            return
        out = document.source.copy()
        out.points = points
        try:
            stored = document.in_plane(write_path(temporary, out, form, mesh.dimension), mesh)
        except WriteError as error:
            raise WriteError(f"{target}: {error}") from error

    write_file(target, produce)
    return stored


def output_format(document: Document, target: str, name: str | None = None) -> Format:
    """Return the format of the output: the one named, else that of the target's extension, else the input's.

    Raises
    ------
    WriteError
        The extension is not known, or the format cannot be written.
    """
    if name is not None:
        form = Format(name)
    elif target == "-" or not Path(target).suffix:
        form = document.format
    else:
        known = formats.by_name(Path(target))
        if known is None:
            raise WriteError(f"{target}: no mesh format has the extension {Path(target).suffix!r}")
        form = known
    if form.reader == document.format.reader and name is None:
        form = document.format
    elif form.binary is None and form.name in ("vtk", "vtk42", "gmsh", "gmsh22", "ply", "stl", "vtu"):
        form = Format(form.name, bool(document.format.binary))
    if form.name not in formats.writers():
        raise WriteError(f"{target}: the format {form.name} cannot be written")
    return form


def _splice(document: Document, points: NDArray[np.floating[Any]]) -> bytes | None:
    """Put points into the original bytes; None where that cannot be done."""
    find_coordinates = SPLICED.get(document.format.reader)
    if find_coordinates is None:
        return None
    try:
        places = find_coordinates(document.data)
    except (ValueError, struct.error):  # meshio made sense of it, we did not
        return None
    return None if places is None else splice(document.data, places, document.source.points, points)


def _read_bytes(path: Path | None) -> bytes:
    """Read a file, or stdin."""
    try:
        data = sys.stdin.buffer.read() if path is None else path.read_bytes()
    except OSError as error:
        raise ReadError(error.strerror or str(error)) from error
    if not data:
        raise ReadError("is empty")
    return data


def _document(name: str, source: Any, data: bytes, form: Format, fix: str | None, regions: str | None) -> Document:
    dimension = _dimension(source)
    starts = np.cumsum([0, *(len(block.data) for block in source.cells)])
    chosen = [i for i, block in enumerate(source.cells) if block.type == SIMPLEX[dimension]]
    simplices = simplices_of(source, dimension)
    ids = np.concatenate([np.arange(starts[i], starts[i + 1]) for i in chosen])

    points, basis = _solved_points(source, simplices, dimension)
    held = {"on other cells of the file": _on_other_cells(source, chosen, len(points))}
    if fix is not None:
        held[f"by --fix {fix}"] = _fixed_by(source, fix)
    mesh = Mesh.build(points, simplices)
    topology = mesh.topology
    reasons = {"on the boundary": topology.boundary}
    for key in _region_arrays(source, regions):
        labels = np.concatenate([source.cell_data[key][i] for i in chosen])
        if labels.ndim != 1:
            raise ReadError(f"the cell data {key!r} are not labels of regions: they have {labels.shape[1]} components")
        reasons[f"between regions of {key}"] = topology.interface(_region_codes(labels, simplices, topology))
    fixed = {}
    for reason, mask in {**reasons, **held}.items():
        counted = mask & (mesh.movable | topology.boundary) if reason == "on the boundary" else mask & mesh.movable
        fixed[reason] = int(counted.sum())
        mesh = mesh.with_fixed(mask)
    # A plane in space has no side from which the numbering could be judged, but for that of constant z.
    seen_from_above = basis is None or bool((basis == np.eye(3)[:2]).all())
    notes = _notes(mesh, len(simplices), seen_from_above)
    return Document(
        name, mesh, form, ids[topology.source], {k: v for k, v in fixed.items() if v}, notes, source, data, basis
    )


def _dimension(source: Any) -> int:
    """3 where there are tetrahedra, 2 where triangles are the cells of the highest dimension."""
    types = [block.type for block in source.cells if len(block.data)]
    if "tetra" in types:
        return 3
    solid = sorted({block.type for block in source.cells if len(block.data) and block.dim == 3})
    if "triangle" in types and not solid:
        return 2
    found = ", ".join(solid or sorted(set(types))) or "none"
    raise ReadError(f"there are no tetrahedra and no plane mesh of triangles in it (cells: {found})")


def _solved_points(
    source: Any, simplices: NDArray[np.int64], dimension: int
) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    points = np.asarray(source.points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] not in (2, 3) or points.shape[1] < dimension:
        raise ReadError(f"its points have {points.shape[-1]} coordinates")
    if points.shape[1] == dimension:
        return points, None
    flat = np.where(np.isfinite(points).all(axis=1, keepdims=True), points[:, :2], np.nan)
    if simplices.min() < 0 or simplices.max() >= len(points):
        return flat, None  # Mesh.build tells what is wrong, here and below
    used = points[np.unique(simplices)]
    if not np.isfinite(used).all() or not np.ptp(used, axis=0).any():
        return flat, None
    basis = plane_basis(used, np.finfo(source.points.dtype).eps if source.points.dtype.kind == "f" else 0.0)
    with np.errstate(invalid="ignore"):  # isolated points may be anything
        return points @ basis.T, basis


def _on_other_cells(source: Any, chosen: list[int], n: int) -> NDArray[np.bool_]:
    """Vertices of cells that are not solved for: lines, boundary triangles, quadrilaterals, ..."""
    mask = np.zeros(n, dtype=bool)
    for i, block in enumerate(source.cells):
        if i in chosen:
            continue
        for row in [block.data] if isinstance(block.data, np.ndarray) and block.data.ndim == 2 else block.data:
            vertices = np.asarray(row, dtype=np.int64)
            mask[vertices[(vertices >= 0) & (vertices < n)]] = True
    return mask


def _fixed_by(source: Any, name: str) -> NDArray[np.bool_]:
    if name not in source.point_data:
        known = ", ".join(sorted(source.point_data)) or "none"
        raise ReadError(f"there is no point data named {name!r} (found: {known})")
    values = np.asarray(source.point_data[name])
    return (values.reshape(len(values), -1) != 0).any(axis=1)


def _region_codes(labels: NDArray[Any], simplices: NDArray[np.int64], topology: Topology) -> NDArray[np.int64]:
    """A number for each simplex of the mesh that stands for its label, or for all labels of its repetitions."""
    codes = np.unique(labels, return_inverse=True)[1].reshape(-1).astype(np.int64)
    if len(topology.source) == len(simplices):
        return codes
    group = np.unique(np.sort(simplices, axis=1), axis=0, return_inverse=True)[1].reshape(-1)
    members: dict[int, set[int]] = {}
    for which, code in zip(group.tolist(), codes.tolist(), strict=True):
        members.setdefault(which, set()).add(code)
    known: dict[frozenset[int], int] = {}
    return np.array([known.setdefault(frozenset(members[g]), len(known)) for g in group[topology.source].tolist()])


def _region_arrays(source: Any, name: str | None) -> list[str]:
    if name is None:
        return [key for key in REGION_ARRAYS if key in source.cell_data]
    if name not in source.cell_data:
        known = ", ".join(sorted(source.cell_data)) or "none"
        raise ReadError(f"there is no cell data named {name!r} (found: {known})")
    return [name]


def _notes(mesh: Mesh, rows: int, seen_from_above: bool) -> tuple[str, ...]:
    topology, (one, many) = mesh.topology, CELL_NAMES[mesh.dimension]

    def count(number: int, singular: str, plural: str) -> str:
        return f"{number:,} {singular if number == 1 else plural}"

    notes = []
    if len(topology.simplices) < rows:
        repeated = count(rows - len(topology.simplices), f"{one} is a repetition", f"{many} are repetitions")
        notes.append(f"{repeated} of another and not counted")
    isolated = topology.n - int(topology.used.sum())
    if isolated:
        notes.append(f"{count(isolated, 'point belongs', 'points belong')} to no {one} and stay as they are")
    if topology.mirrored and seen_from_above:
        notes.append("the elements are numbered the other way round (mirrored); solved so, the numbering is kept")
    if not mesh.movable.any():
        notes.append("no vertex is free to move")
    return tuple(notes)
