"""A mesh as it came from a file: what moves, what is held, and how moved points go back into the file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from meshfix_cli import kernels
from meshfix_cli.errors import InvalidMeshError, ReadError, listed
from meshfix_cli.mesh.elements import COLLAPSED, counted, dimension_of, words
from meshfix_cli.mesh.mesh import BETWEEN, LARGEST_COORDINATE, ON_BOUNDARY, Mesh, mask_of
from meshfix_cli.mesh.topology import Topology, refers_outside
from meshfix_cli.meshfile.coincident import first_of_each_place
from meshfix_cli.meshfile.notes import concave, notes_on
from meshfix_cli.meshfile.plane import is_level, plane_basis
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.solved import Part, Solved, ids_of, solved_of, solved_runs, turned
from meshfix_cli.meshfile.source import REGIONS, Cells, Source
from meshfix_cli.meshfile.splice import Turned

if TYPE_CHECKING:
    from meshfix_cli.mesh.ties import Ties

FREE = "none"  # the name of no array of regions, by which interfaces are freed
SAME_PLANE = 1e-6  # of one, by which the cosine between two planes may be less
# Reasons to hold vertices that may slide all the same, where they are asked to.
ON_CELLS = "on other cells of the file"
BY_FILE = "by the file"
CROWDED = "on edges of more than two elements"
OF_CURVED = "of curved elements"
HALFWAY = "between corners of other elements"


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
        For each element of the mesh the number that the file gives to its cell, or, where it gives none, the position
        of this among all cells of the file, from 0.
    not_judged : dict
        Number of elements of each type that are of the mesh's dimension, held, and not judged.
    notes : tuple of str
        What a user should know about the file, a sentence each.
    source : Source
    solved : Solved
        Which cells of the file the elements are, repetitions included.
    basis : (2, 3) float64 or None
        Spans the plane of a planar mesh in space.
    holds : dict
        For each reason the vertices (n,) bool that it holds.
    regions : tuple of (m,) int64
        Numbers of the regions that the elements are of, for each array whose interfaces are held.
    copies : (n,) int64 or None
        For each point the one that stands for it in the mesh, where points at one place are joined.
    arbitrary : (m,) bool or None
        The elements that are numbered the other way round, where the file's numbering says nothing of that.
    ties : Ties or None
        Which nodes lie between the corners of elements, and follow these; None: there are none.
    displaced : (n, d) float or None
        Where the points are after a displacement, as the file holds them; None: where the file has them.
    """

    name: str
    mesh: Mesh
    format: Format
    ids: NDArray[np.int64]
    not_judged: dict[str, int]
    notes: tuple[str, ...]
    source: Source = field(repr=False)
    solved: Solved = field(repr=False)
    basis: NDArray[np.float64] | None
    holds: dict[str, NDArray[np.bool_]] = field(repr=False)
    regions: tuple[NDArray[np.int64], ...] = field(repr=False)
    copies: NDArray[np.int64] | None = None
    arbitrary: NDArray[np.bool_] | None = None
    ties: Ties | None = field(default=None, repr=False)
    displaced: NDArray[np.floating[Any]] | None = field(default=None, repr=False)

    @property
    def fixed(self) -> dict[str, int]:
        """Number of vertices held for each reason; a vertex counts for the first that applies."""
        left, fixed = self.mesh.topology.used & ~self.mesh.movable, {}
        for reason, mask in self.holds.items():
            fixed[reason] = int((mask & left).sum())
            left = left & ~mask
        return {reason: count for reason, count in fixed.items() if count}

    @property
    def files(self) -> tuple[str, ...]:
        """The names of the files that hold the mesh."""
        pieces = self.source.pieces
        return (self.name, *(map(str, pieces.paths) if pieces else ()))

    @property
    def parts(self) -> tuple[Part, ...]:
        """The elements of the mesh, without repetitions, with their vertices as the file numbers them."""
        return self.solved.some(self.mesh.topology.source)

    @property
    def higher_order(self) -> dict[str, int]:
        """Number of elements of each type that has more nodes than corners."""
        counts: dict[str, int] = {}
        for part in () if self.ties is None else self.parts:
            if part.type != part.key:
                counts[part.type] = counts.get(part.type, 0) + len(part.vertices)
        return counts

    def groups(self) -> dict[str, dict[int, int]]:
        """Return how many cells each group of the file has, by name and by dimension, see `groups.Group.counts`."""
        from meshfix_cli.meshfile.groups import groups_of  # which few runs ask for

        return {name: group.counts for name, group in groups_of(self.source).items()}

    def outputs(self, target: str, form: Format) -> tuple[str, ...]:
        """Return the names of the files that an output in a format has; WriteError where it cannot be."""
        pieces = self.source.pieces
        return (target, *(pieces.targets(target) if pieces and form == self.format else ()))

    def file_points(self, mesh: Mesh) -> NDArray[np.floating[Any]]:
        """Return the points of a moved mesh as the file holds them: shape, type and the bits of fixed vertices."""
        original = self.source.points if self.displaced is None else self.displaced
        points: NDArray[np.floating[Any]] = original.copy()
        moved = kernels.moved(self.mesh.points, mesh.points, 1).view(bool) & self.mesh.used
        with np.errstate(over="ignore"):  # `in_plane` tells when float32 overflows
            if self.basis is None:
                np.copyto(points, mesh.points, casting="same_kind", where=moved[:, None])
            elif np.isin(self.basis, (0.0, 1.0)).all():
                points[np.ix_(moved, self.basis.argmax(axis=1))] = mesh.points[moved]
            else:
                points[moved] = original[moved] + (mesh.points[moved] - self.mesh.points[moved]) @ self.basis
        if not self.source.exact:
            points[moved] = self.source.rounded(points[moved])
        if self.ties is not None and mesh.quadratic is None:
            followed = self.ties.follow(points, moved)
            if not self.source.exact:
                points[followed] = self.source.rounded(points[followed])
            moved = moved | followed
        if self.copies is not None:
            behind = np.flatnonzero(moved[self.copies] & ~mesh.topology.used)
            points[behind] = points[self.copies[behind]]
        return points

    def as_stored(self, mesh: Mesh) -> Mesh:
        """Return a moved mesh with the coordinates rounded as the file will hold them."""
        return self.in_plane(self.file_points(mesh).astype(np.float64), mesh)

    def in_plane(self, points: NDArray[np.float64], mesh: Mesh) -> Mesh:
        """Return a moved mesh at points (n, 2 or 3) in the coordinates of the file."""
        large = ~(np.abs(points) <= LARGEST_COORDINATE)
        if large.any() and large[mesh.topology.used].any():
            raise InvalidMeshError("the coordinates are too large for the numbers of the file")
        return mesh.with_points(np.ascontiguousarray(points if self.basis is None else _flat(points, self.basis)))

    def seen_from(self, other: Document) -> NDArray[np.float64] | None:
        """Return the points (n, 2) as another document in the same plane in space has them; None: it lies elsewhere."""
        if self.basis is None or other.basis is None or abs(np.linalg.det(self.basis @ other.basis.T)) < 1 - SAME_PLANE:
            return None
        return other.in_plane(self.source.points.astype(np.float64), self.mesh).points

    def first_valid_as_stored(self, *meshes: Mesh, threads: int = 1) -> tuple[Mesh, int]:
        """Return the first of some moved meshes that is valid as the file stores it, else the best.

        The second value is the number of elements of the first mesh that are inverted as the file stores it.
        """
        ranked = []
        for mesh in meshes:
            inverted, smallest = self.as_stored(mesh).check(threads)
            ranked.append(((inverted, -smallest), mesh))
            if inverted == 0:
                break
        return min(ranked, key=lambda pair: pair[0])[1], ranked[0][0][0]

    def is_file(self, target: str) -> bool:
        """Whether a target is the file that was read, under whatever name."""
        here, there = Path(self.name), Path(target)
        return target != "-" and here.is_file() and there.is_file() and here.samefile(there)

    def is_as_read(self, mesh: Mesh, form: Format) -> bool:
        """Whether a moved mesh is, in a format, the very file that was read, and that file is all there is."""
        if self.source.data is None or form != self.format:
            return False
        return self.file_points(mesh).tobytes() == self.source.points.tobytes()

    def is_kept_by(self, form: Format) -> bool:
        """Whether writing in a format keeps all but the coordinates, byte for byte."""
        return form == self.format and self.source.spliced

    def reversed_cells(self) -> dict[int, Turned]:
        """Return the cells, by the number of their run, whose numbering has the negative orientation.

        Of surfaces those numbered against the rest, or where that encloses something and is seen from inside, the rest.

        Raises
        ------
        ReadError
            They are strips of triangles, in which no triangle can be renumbered alone.
        """
        topology = self.mesh.topology
        if self.mesh.surface is not None:
            from meshfix_cli.mesh.surface import inward

            topology = replace(topology, flipped=topology.flipped ^ inward(self.mesh))
        return self._turned(topology)

    def oriented(self) -> Source:
        """Return the source for a format in which the numbering of cells tells their orientation."""
        if self.arbitrary is None:
            return self.source
        return with_reversed(self.source, self._turned(replace(self.mesh.topology, flipped=self.arbitrary)))

    def _turned(self, topology: Topology) -> dict[int, Turned]:
        rows: dict[int, NDArray[np.int64]] = {}
        for part in self.solved.some(np.flatnonzero(_reversed(self.solved, topology))):
            here = np.arange(len(part.vertices)) if part.rows is None else part.rows
            rows[part.run] = np.concatenate([rows.get(part.run, here[:0]), here])
        return turned(self.source.cells, rows)


def build(
    name: str,
    source: Source,
    form: Format,
    fix: Sequence[str],
    regions: str | None,
    join_points: bool = False,
    threads: int = 1,
    fixed: ArrayLike | None = None,
) -> Document:
    """Make a document of what a file holds; the parameters are those of `read`."""
    solved = _solved(source)
    free = regions == FREE and FREE not in source.arrays.cell
    if regions is not None and not free:
        source = _with_regions(source, regions)
    points, basis = _solved_points(source, solved)
    copies = _copies(points, solved) if join_points else None
    if copies is not None:
        solved = solved_of([_joined(run, copies) for run in source.cells])
    held = {ON_CELLS: _on_other_cells(solved, len(points))}
    if source.held is not None:
        held[BY_FILE] = source.held
    named = {one: _fixed_by(source, one) for one in fix}
    held |= {f"by --fix {one}": mask for one, mask in named.items()}
    if fixed is not None:
        held["by fixed"] = mask_of(fixed, len(points))
    mesh = replace(Mesh.build(points, solved.blocks, threads=threads), apart=source.apart)
    arbitrary = None if source.oriented else mesh.topology.flipped
    if not source.oriented:  # the numbering says nothing
        mesh = replace(mesh, topology=replace(mesh.topology, flipped=np.zeros_like(mesh.topology.flipped)))
    topology = mesh.topology
    holds, between = _ends(mesh), []
    for key in () if free else source.regions:
        if key not in source.arrays.cell:
            raise ReadError(
                f"the cell data {key!r}, which tell regions apart, cannot be read; --regions none ignores them"
            )
        labels = solved.of_elements(source.arrays.cell[key])
        if key not in REGIONS and key != regions and not _are_labels(labels):
            continue
        if labels.ndim != 1:
            components = counted(labels.shape[1], "component", "components")
            raise ReadError(f"the cell data {key!r} are not labels of regions: they have {components}")
        between.append(_region_codes(labels, solved, topology))
        holds[f"{BETWEEN} {key}"] = topology.interface(between[-1])
    ties, curved = solved.ties(source.points)
    if copies is not None:
        held = {reason: _of_copies(mask, copies) for reason, mask in held.items()}
    if ties is not None:
        held[HALFWAY] = ties.nodes & topology.used
    if mesh.surface is not None and curved.any():
        held[OF_CURVED] = _corners_of(solved, curved, len(points))
    elif ties is not None and curved.any():
        from meshfix_cli.meshfile.curving import check_plane, quadratic_of

        if topology.m < solved.m:
            raise ReadError(
                "elements are curved and some are repeated: which of them have other nodes is not looked at"
            )
        if basis is not None:
            check_plane(source.points, points, basis, ties)
        parts = solved.some(topology.source)
        asked = np.logical_or.reduce([mask for reason, mask in held.items() if reason != ON_CELLS])
        masks = asked, held[ON_CELLS]
        quadratic = quadratic_of(parts, curved[topology.source], mesh, ties, between, *masks)
        mesh = replace(mesh, quadratic=quadratic)
    if ties is not None:
        held = {reason: ties.with_corners(mask) for reason, mask in held.items()}
    holds |= held
    for mask in holds.values():
        mesh = mesh.with_fixed(mask)
    # A plane in space has no side from which the numbering could be judged, but for that of constant z.
    seen_from_above = basis is None or is_level(basis)
    notes = (*source.notes, *notes_on(mesh, solved, seen_from_above, copies, ties), *concave(mesh, form))
    notes += tuple(f"--fix {one} holds no vertex: there is none in it" for one, mask in named.items() if not mask.any())
    ids = solved.of_elements(_ids(source))
    ids = ids if topology.m == len(ids) else ids[topology.source]
    return Document(
        name,
        mesh,
        form,
        ids,
        solved.not_judged(),
        notes,
        source,
        solved,
        basis,
        holds,
        tuple(between),
        copies,
        arbitrary,
        ties,
    )


def with_reversed(source: Source, cells: Mapping[int, Turned]) -> Source:
    """Return a source that is to be written anew, with some cells turned."""
    runs = list(source.cells)
    for run, (rows, order) in cells.items():
        vertices = runs[run].vertices.copy()
        vertices[rows] = vertices[rows][:, order]
        runs[run] = replace(runs[run], vertices=vertices)
    return replace(source, cells=runs, data=None)


def _solved(source: Source) -> Solved:
    """Return what is solved for: no cell may be of a higher dimension.

    Collapsed elements name points that are there, as those that are judged do.
    """
    solved = solved_of(source.cells)
    if solved.parts:
        if any(run.type.startswith(COLLAPSED) for run in solved.rest):
            _check_named(source)
        return solved
    types = {run.type for run in solved.rest if len(run.vertices)}
    solid = sorted(one for one in types if dimension_of(one) == 3)
    found = ", ".join(solid or sorted(types)) or "none"
    raise ReadError(f"there are no elements in it that are judged, of solids, planes or surfaces (cells: {found})")


def _check_named(source: Source) -> None:
    n = len(source.points)
    for i in solved_runs(source.cells):
        run = source.cells[i]
        astray = np.flatnonzero(((run.vertices < 0) | (run.vertices >= n)).any(axis=1))
        if len(astray):
            raise refers_outside(f"a {words(run.type)[0]}", run.vertices[astray[0]], n)


def _ids(source: Source) -> list[NDArray[np.int64]]:
    starts = np.cumsum([0, *(len(run.vertices) for run in source.cells)]).tolist()
    return [ids_of(run, start) for run, start in zip(source.cells, starts, strict=False)]


def _are_labels(values: NDArray[Any]) -> bool:
    """Whether an array of which only the name says so tells materials apart: whole numbers, one for each cell."""
    if values.ndim != 1 or values.dtype.kind not in "biuf":
        return False
    return bool(values.dtype.kind in "biu" or (np.isfinite(values) & (values == np.round(values))).all())


def _ends(mesh: Mesh) -> dict[str, NDArray[np.bool_]]:
    """Return the vertices (n,) at which a mesh ends, for each reason."""
    topology = mesh.topology
    if mesh.surface is None:
        return {ON_BOUNDARY: topology.boundary}
    from meshfix_cli.mesh.sides import crowded_edges

    marked = np.zeros(len(topology.connectivity.vertices), dtype=bool)
    marked[crowded_edges(topology)] = True
    crowded = topology.of_vertices(marked)
    ends = {ON_BOUNDARY: topology.boundary & ~crowded}
    return {**ends, CROWDED: crowded} if crowded.any() else ends


def _corners_of(solved: Solved, which: NDArray[np.bool_], n: int) -> NDArray[np.bool_]:
    """Mark the corners (n,) of some elements (m,)."""
    mask = np.zeros(n, dtype=bool)
    for part in solved.some(np.flatnonzero(which)):
        mask[part.vertices] = True
    return mask


def _copies(points: NDArray[np.float64], solved: Solved) -> NDArray[np.int64]:
    """Return for each point the first at its place that an element has; itself for what `Mesh.build` will refuse."""
    used = np.unique(solved.nodes())
    return first_of_each_place(points, used[(used >= 0) & (used < len(points))])


def _joined(run: Cells, copies: NDArray[np.int64]) -> Cells:
    """Return cells that may be solved for with the points that stand for their vertices."""
    if not isinstance(run.vertices, np.ndarray):
        return run
    inside = (run.vertices >= 0) & (run.vertices < len(copies))
    return replace(run, vertices=np.where(inside, copies[np.where(inside, run.vertices, 0)], run.vertices))


def _of_copies(mask: NDArray[np.bool_], copies: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Mark also the points that stand for marked ones."""
    marked = mask.copy()
    marked[copies[mask]] = True
    return marked


def _reversed(solved: Solved, topology: Topology) -> NDArray[np.bool_]:
    """(k,) bool: of all elements of the file, those with the negative orientation; repetitions may differ."""
    if len(topology.source) == solved.m:
        return topology.flipped
    odd, group = solved.odd(), solved.groups()
    positive = np.empty(group.max() + 1, dtype=bool)  # which of the two orders is positive
    positive[group[topology.source]] = odd[topology.source] ^ topology.flipped
    return odd != positive[group]


def _solved_points(source: Source, solved: Solved) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    dimension = solved.dimension
    with np.errstate(invalid="ignore"):  # a signalling NaN; Mesh.build tells where there is any
        points = np.asarray(source.points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] not in (2, 3) or points.shape[1] < dimension:
        raise ReadError(f"its points have {counted(points.shape[-1], 'coordinate', 'coordinates')}")
    if points.shape[1] == dimension:
        return points, None
    vertices = solved.vertices()
    if vertices.min() < 0 or vertices.max() >= len(points):
        return _seen_from_above(points), None  # Mesh.build tells what is wrong, here and below
    used = points[kernels.used_vertices(vertices.astype(np.int32, copy=False).reshape(-1, 1), len(points))]
    if not (np.abs(used) <= LARGEST_COORDINATE).all() or not np.ptp(used, axis=0).any():
        return _seen_from_above(points), None
    basis = plane_basis(used, float(np.finfo(source.points.dtype).eps))
    return (points, None) if basis is None else (_flat(points, basis), basis)


def _seen_from_above(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(np.isfinite(points).all(axis=1, keepdims=True), points[:, :2], np.nan)


def _flat(points: NDArray[np.float64], basis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points (n, 3) in the coordinates of a plane."""
    with np.errstate(invalid="ignore", over="ignore"):  # isolated points may be anything
        return points @ basis.T


def _on_other_cells(solved: Solved, n: int) -> NDArray[np.bool_]:
    """Vertices of cells that are not solved for: lines, facets on the boundary, polyhedra, ..."""
    mask = np.zeros(n, dtype=bool)
    for run in solved.rest:
        for row in [run.vertices] if isinstance(run.vertices, np.ndarray) else run.vertices:
            vertices = np.asarray(row, dtype=np.int64)
            mask[vertices[(vertices >= 0) & (vertices < n)]] = True
    return mask


def _fixed_by(source: Source, name: str) -> NDArray[np.bool_]:
    """Mark the points (n,) that an array or, where there is none of this name, a group holds."""
    if name in source.arrays.point and name not in source.arrays.point_sets:  # which a few arrays are as well
        values = np.asarray(source.arrays.point[name])
        return (values.reshape(len(values), -1) != 0).any(axis=1)
    from meshfix_cli.meshfile.groups import groups_of

    groups = groups_of(source)
    if name not in groups:
        known = listed(sorted({*source.arrays.point, *groups})) or "none"
        raise ReadError(f"there is no point data, set or group named {name!r} (found: {known})")
    points = groups[name].points
    mask = np.zeros(len(source.points), dtype=bool)
    mask[points[(points >= 0) & (points < len(mask))]] = True
    return mask


def _region_codes(labels: NDArray[Any], solved: Solved, topology: Topology) -> NDArray[np.int64]:
    """A number for each element of the mesh that stands for its label, or for all labels of its repetitions."""
    codes = np.unique(labels, return_inverse=True)[1].reshape(-1).astype(np.int64)
    if len(topology.source) == solved.m:
        return codes
    group = solved.groups()
    members: dict[int, set[int]] = {}
    for which, code in zip(group.tolist(), codes.tolist(), strict=True):
        members.setdefault(which, set()).add(code)
    known: dict[frozenset[int], int] = {}
    return np.array([known.setdefault(frozenset(members[g]), len(known)) for g in group[topology.source].tolist()])


def _with_regions(source: Source, name: str) -> Source:
    """Let another array tell the regions apart; what has been read is not read again."""
    if name not in source.arrays.cell:
        known = listed(sorted(source.arrays.cell)) or "none"
        raise ReadError(f"there is no cell data named {name!r} (found: {known})")
    return replace(source, regions=(name,), load=lambda: source.arrays)
