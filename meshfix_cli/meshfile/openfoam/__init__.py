"""OpenFOAM's meshes: a folder polyMesh with lists of points, of faces, and of the cells on both sides of each face.

Only `points` changes. A case, a region of it, or the empty .foam file that stands for a case are as good as the folder.

Source: OpenFOAM User Guide, "Mesh description", "Mesh files", "Boundaries"; OpenFOAM, "ZoneMesh.C".
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from meshfix_cli.errors import ReadError, WriteError, naming
from meshfix_cli.meshfile.compressed import is_compressed, packed, unpacked
from meshfix_cli.meshfile.faces import Faces
from meshfix_cli.meshfile.openfoam.lists import File, Labels
from meshfix_cli.meshfile.source import Cells, Source
from meshfix_cli.meshfile.splice import InPlace, Places, Points, Turned
from meshfix_cli.meshfile.tables import Int64, Runs
from meshfix_cli.meshfile.together import Together

SUFFIX = ".foam"
_ZONE = "openfoam:zone"
_SIZES = {3: "triangle", 4: "quad"}
_TIME = re.compile(r"\d+(\.\d*)?(e[+-]?\d+)?")
_RANGE = re.compile(rb"\b(nFaces|startFace)\s+(\d{1,18})\s*;")
_TYPE = re.compile(rb"\btype\s+(\w+)\s*;")
# Types of patches whose points have partners: on the other half, in the mesh of another process, on the other side of a
# mesh that is one cell thick.
_MATCHED = frozenset(b"cyclic cyclicSlip nonuniformTransformCyclic processor processorCyclic empty wedge".split())


def folder_of(path: Path) -> Path:
    """Return where the mesh is that a folder, or a file in it, stands for; ReadError where there is none."""
    base = path if path.is_dir() else path.parent
    for folder in (base / "constant" / "polyMesh", base / "polyMesh", base):
        if _file(folder, "points") and _file(folder, "faces"):
            return folder
    raise ReadError(
        "holds no mesh that is read as a folder: there is no constant/polyMesh of OpenFOAM, no mesh.header of Elmer"
    )


def parse(_: bytes, path: Path | None) -> Source:
    """Read the mesh that a path stands for."""
    if path is None:
        raise ReadError("is a file of OpenFOAM, whose meshes are folders: name the folder, or the case")
    folder = folder_of(path)
    points = _file(folder, "points")
    assert points is not None
    marked = [path] if path.suffix == SUFFIX else []
    copied = [one for one in sorted(folder.rglob("*")) if one.is_file() and one != points]

    def places(target: Path) -> list[Path]:
        there = target / "constant" / "polyMesh" if target.name != "polyMesh" else target
        if target.suffix == SUFFIX:
            if not marked:
                raise WriteError(f"{target}: a folder goes into a folder; name one as OUTPUT")
            there = target.parent / "constant" / "polyMesh"
        mine = [there / one.relative_to(folder) for one in (points, *copied)]
        others = {one for one in there.rglob("*") if one.is_file()} - set(mine)
        if others:
            raise WriteError(f"{target}: has a file {min(others).name} of another mesh; name another OUTPUT")
        return [*mine, *[target if target.suffix == SUFFIX else target / one.name for one in marked]]

    def read(contents: Sequence[bytes]) -> Source:
        data = unpacked(contents[0]) if is_compressed(contents[0]) else contents[0]
        source, layout = _source(data, folder)

        def written(original: Points, moved: Points, turned: Mapping[int, Turned]) -> list[bytes]:
            new = layout.rewritten(original, moved, turned)
            return [contents[0] if new == data else packed(new) if is_compressed(contents[0]) else new]

        pieces = Together(path, [points], layout, written, read, [*copied, *marked], places)
        return replace(source, pieces=pieces, notes=_of_later_times(folder))

    return read([points.read_bytes()])


def _of_later_times(folder: Path) -> tuple[str, ...]:
    """Tell of the points that a mesh in motion has in a folder of its own for each time."""
    parts = folder.resolve().parts
    if "constant" not in parts:
        return ()
    at = len(parts) - 1 - parts[::-1].index("constant")
    case, rest = Path(*parts[:at]), Path(*parts[at + 1 :])
    times = {one.relative_to(case).parts[0] for one in case.glob(f"*/{rest}/points*")}
    found = sorted((time for time in times if _TIME.fullmatch(time)), key=float)
    if not found:
        return ()
    return (f"the points of constant are read, and those of later times, as in {found[-1]}/{rest}, stay as they are",)


def _file(folder: Path, name: str) -> Path | None:
    return next((one for one in (folder / name, folder / f"{name}.gz") if one.is_file()), None)


def _bytes(path: Path) -> bytes:
    data = path.read_bytes()
    return unpacked(data) if is_compressed(data) else data


def _read(folder: Path, name: str) -> File | None:
    path = _file(folder, name)
    if path is None:
        return None
    with naming(name):
        return File.of(_bytes(path))


def _source(data: bytes, folder: Path) -> tuple[Source, InPlace]:
    """Join the coordinates with what the other files of a folder tell about them."""
    with naming("points"):
        points = File.of(data)
        coordinates = points.vectors()
    faces, runs = _faces(folder, len(coordinates.begin)), Runs()
    zones = list(_zones(folder, "cellZones"))
    zone_of = np.zeros(faces.cells, dtype=np.int64)
    for number, (name, cells) in enumerate(zones, start=1):
        if len(cells) and not 0 <= cells.min() <= cells.max() < len(zone_of):
            raise ReadError(f"cellZones: {name} names a cell that is not there")
        zone_of[cells] = number
    for kind, vertices, ids in faces.elements():
        for name, cells in zones:
            runs.put(name, len(runs.cells), np.flatnonzero(np.isin(ids, cells)))
        runs.add(Cells(kind, vertices, ids), _no_corners, {_ZONE: zone_of[ids]})
    patches, held = list(_patches(folder)), np.zeros(len(coordinates.begin), dtype=bool)
    for name, some in (*((name, some) for name, _, some in patches), *_zones(folder, "faceZones")):
        _add_facets(runs, faces, name, some)
    for _, patch_type, some in patches:
        if patch_type in _MATCHED:
            held[faces.vertices[np.repeat(np.isin(np.arange(len(faces.owner)), some), np.diff(faces.offsets))]] = True
    point_sets = dict(_zones(folder, "pointZones"))
    layout = InPlace(data, coordinates, runs.corners)
    regions = (_ZONE,) * (len(zones) > 0)
    values = coordinates.read(points.data)
    source = Source(
        values, runs.cells, None, lambda: runs.arrays(point_sets), regions, held=held if held.any() else None
    )
    return source, layout


def _faces(folder: Path, n: int) -> Faces:
    def read(name: str, what: Callable[[File], tuple[Labels, Any]]) -> tuple[Labels, Any]:
        file = _read(folder, name)
        if file is None:
            raise ReadError(f"is not a readable mesh of OpenFOAM: there is no file {name}")
        with naming(name):
            return what(file)

    offsets, vertices = read("faces", File.faces)
    owner, neighbour = (read(name, File.labels)[0] for name in ("owner", "neighbour"))
    count = len(offsets) - 1
    if len(owner) != count or len(neighbour) > count or (owner < 0).any() or (np.diff(offsets) < 3).any():
        raise ReadError("is not a readable mesh of OpenFOAM: faces, owner and neighbour do not fit")
    if len(vertices) and not 0 <= vertices.min() <= vertices.max() < n:
        raise ReadError("is not a readable mesh of OpenFOAM: a face names a point that is not there")
    kind = np.result_type(offsets, vertices, owner, neighbour)
    both_sides = np.full(count, -1, dtype=kind)
    np.maximum(neighbour, -1, out=both_sides[: len(neighbour)])
    offsets, vertices, owner = (values.astype(kind, copy=False) for values in (offsets, vertices, owner))
    return Faces(offsets, vertices, owner, both_sides)


def _patches(folder: Path) -> Iterator[tuple[str, bytes, Int64]]:
    """Give the names, the types and the faces of the parts of the boundary."""
    file = _read(folder, "boundary")
    for name, text, _ in file.blocks() if file else ():
        found = {key: int(number) for key, number in _RANGE.findall(text)}
        if len(found) == 2:
            kind = _TYPE.search(text)
            some = found[b"startFace"] + np.arange(min(found[b"nFaces"], len(file.data) if file else 0))
            yield name, kind[1] if kind else b"", some


def _zones(folder: Path, name: str) -> Iterator[tuple[str, Int64]]:
    """Give the names and the members of the zones of one kind."""
    file = _read(folder, name)
    if file is None:
        return
    with naming(name):
        yield from ((zone, members) for zone, _, members in file.blocks())


def _add_facets(runs: Runs, faces: Faces, name: str, some: Int64) -> None:
    """Take the faces of a patch or zone for cells, so that they are found by its name."""
    if len(some) and not 0 <= some.min() <= some.max() < len(faces.owner):
        raise ReadError(f"is not a readable mesh of OpenFOAM: {name} has a face that is not there")
    sizes = np.diff(faces.offsets)[some]
    for size, kind in _SIZES.items():
        if len(mine := some[sizes == size]):
            vertices = faces.vertices[faces.offsets[mine][:, None] + np.arange(size)]
            runs.add(Cells(kind, vertices), _no_corners, sets=(name,))
    if len(mine := some[~np.isin(sizes, tuple(_SIZES))]):
        loops = [faces.vertices[slice(*faces.offsets[face : face + 2])] for face in mine.tolist()]
        runs.add(Cells("polygon", loops), _no_corners, sets=(name,))


def _no_corners() -> Places:
    raise ReadError("has cells that are made of faces, of which none can be renumbered alone")
