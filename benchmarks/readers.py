"""CPU seconds to read and to write a mesh: `make bench`, or `python benchmarks/readers.py [--tets N] [FORMAT...]`.

The same tetrahedra stand in files of each format, written here. What is measured is all that a reader does: points,
cells, and where the coordinates stand; and all that it takes to write the mesh after each free vertex has moved, which
is most of them. Formats are read and written in turns; the least of several runs, and how many times that of the text
of VTK reading is.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.meshfile.reading import parse, read
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.source import Source
from meshfix_cli.meshfile.writing import write

sys.path.insert(0, str(Path(__file__).parents[1] / "sample_meshes"))
import generate

Points = NDArray[np.float64]
Tets = NDArray[np.integer[Any]]
HEADER = 'FoamFile\n{{\n    format {};\n    arch "LSB;label=32;scalar=64";\n    class {};\n    object {};\n}}\n\n'


def lines(form: str, rows: NDArray[Any]) -> str:
    """Return a line for each row."""
    return "".join(form % tuple(row) for row in rows.tolist())


def numbered(form: str, rows: NDArray[Any]) -> str:
    """Return a line for each row, with its number from 1 in front."""
    return "".join(form % (number, *row) for number, row in enumerate(rows.tolist(), 1))


def vtk(path: Path, points: Points, tets: Tets) -> None:
    """Write text of version 4.2."""
    with path.open("w") as file:
        file.write("# vtk DataFile Version 4.2\nmesh\nASCII\nDATASET UNSTRUCTURED_GRID\n")
        file.write(f"POINTS {len(points)} double\n" + lines("%r %r %r\n", points))
        file.write(f"CELLS {len(tets)} {5 * len(tets)}\n" + lines("4 %d %d %d %d\n", tets))
        file.write(f"CELL_TYPES {len(tets)}\n" + "10\n" * len(tets))


def su2(path: Path, points: Points, tets: Tets) -> None:
    """Write a zone without markers."""
    with path.open("w") as file:
        file.write(f"NDIME= 3\nNELEM= {len(tets)}\n" + lines("10 %d %d %d %d\n", tets))
        file.write(f"NPOIN= {len(points)}\n" + lines("%r %r %r\n", points) + "NMARK= 0\n")


def nastran(grid: str, tetra: str) -> Callable[[Path, Points, Tets], None]:
    """Return what writes cards, by the formats of a point and of an element."""

    def write(path: Path, points: Points, tets: Tets) -> None:
        path.write_text(f"BEGIN BULK\n{numbered(grid, points)}{numbered(tetra, tets + 1)}ENDDATA\n")

    return write


def faces_of(tets: Tets) -> tuple[Tets, NDArray[Any], NDArray[Any]]:
    """Return faces (f, 3), owners (f,) and neighbours (i,) in OpenFOAM's order: inner ones first, by their owners."""
    loops = tets[:, ELEMENTS["tetra"].shape.facets].reshape(-1, 3)
    order = np.lexsort(np.sort(loops, axis=1).T[::-1])
    same = (np.diff(np.sort(loops, axis=1)[order], axis=0) == 0).all(axis=1)
    first, second = order[:-1][same], order[1:][same]
    first, second = np.minimum(first, second), np.maximum(first, second)
    by_owner = np.lexsort([second // 4, first // 4])
    first, second = first[by_owner], second[by_owner]
    outer = np.setdiff1d(np.arange(len(loops)), np.concatenate([first, second]))
    faces = np.concatenate([first, outer])
    return loops[faces], faces // 4, second // 4


def openfoam(binary: bool) -> Callable[[Path, Points, Tets], None]:
    """Return what writes a folder."""

    def write(folder: Path, points: Points, tets: Tets) -> None:
        folder.mkdir()

        def put(kind: str, name: str, *lists: tuple[str, NDArray[Any]]) -> None:
            with (folder / name).open("wb") as file:
                file.write(HEADER.format("binary" if binary else "ascii", kind, name).encode())
                for form, rows in lists:
                    content = rows.tobytes() if binary else ("\n" + lines(form, rows)).encode()
                    file.write(f"{len(rows)}\n(".encode() + content + b")\n")

        faces, owner, neighbour = faces_of(tets)
        put("vectorField", "points", ("(%r %r %r)\n", points))
        if binary:
            offsets = np.arange(0, faces.size + 1, 3, dtype="<i4")
            put("faceCompactList", "faces", ("", offsets), ("", faces.astype("<i4").ravel()))
        else:
            put("faceList", "faces", ("3(%d %d %d)\n", faces))
        for name, cells in (("owner", owner), ("neighbour", neighbour)):
            put("labelList", name, ("%d\n", cells.astype("<i4")[:, None]))

    return write


def through_meshio(name: str) -> Callable[[Path, Points, Tets], None]:
    """Return what lets meshio write a format of binary arrays."""
    return lambda path, points, tets: meshio.write(path, meshio.Mesh(points, [("tetra", tets)]), file_format=name)


_CTETRA = "CTETRA  %-8d1       %-8d%-8d%-8d%-8d\n"
FORMATS: dict[str, tuple[str, Callable[[Path, Points, Tets], None]]] = {
    "VTK": ("vtk42", vtk),
    "SU2": ("su2", su2),
    "Nastran, 8 columns": ("nastran", nastran("GRID    %-8d        %8.5f%8.5f%8.5f\n", _CTETRA)),
    "Nastran, 16 columns": (
        "nastran",
        nastran("GRID*   %-16d                %16.13f%16.13f\n*       %16.13f\n", _CTETRA),
    ),
    "Nastran, free": ("nastran", nastran("GRID,%d,,%.13f,%.13f,%.13f\n", "CTETRA,%d,1,%d,%d,%d,%d\n")),
    "XDMF": ("xdmf", through_meshio("xdmf")),
    "Exodus": ("exodus", through_meshio("exodus")),
    "OpenFOAM, text": ("openfoam", openfoam(binary=False)),
    "OpenFOAM, binary": ("openfoam", openfoam(binary=True)),
}


def cpu(work: Callable[[], object]) -> float:
    """Return the CPU seconds of one call."""
    start = time.process_time()
    work()
    return time.process_time() - start


def reader(form: str, path: Path) -> Callable[[], Source]:
    """Return what reads a file or folder, with what it does to open it."""
    return lambda: parse(b"" if path.is_dir() else path.read_bytes(), Format(form), path)


def writer(form: str, path: Path) -> Callable[[], object]:
    """Return what writes a mesh whose free vertices have all moved, beside the file or folder it was read from."""
    document = read(path, form=form)
    mesh = document.mesh
    moved = mesh.with_points(mesh.points + 1e-3 * mesh.movable[:, None] * np.sin(mesh.points[:, ::-1]))
    target = path.with_name(f"moved {path.name}")
    return lambda: write(document, moved, str(target), document.format)


def least(works: Iterable[Callable[[], object]], repeats: int) -> list[float]:
    """Return the least CPU seconds of each, measured in turns."""
    return np.min([[cpu(work) for work in works] for _ in range(repeats)], axis=0).tolist()


def main() -> None:
    """Print one row for each format."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("formats", nargs="*", metavar="FORMAT", help=f"default: all of {', '.join(FORMATS)}")
    parser.add_argument("--tets", type=int, default=1_000_000, help="about so many")
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    layers = max(2, round(18 * (options.tets / 1e6) ** (1 / 3)))
    points, tets = generate.bracket(math.sqrt(layers / (29600 / 1e6 * options.tets)), layers)
    chosen = ["VTK", *(name for name in options.formats or FORMATS if name != "VTK")]
    with tempfile.TemporaryDirectory() as folder:
        reads, writes = [], []
        for name in chosen:
            form, make = FORMATS[name]
            path = Path(folder) / name
            make(path, points, tets)
            source = parse(b"" if path.is_dir() else path.read_bytes(), Format(form), path)
            assert np.allclose(source.points, points, atol=1e-5)
            assert sum(len(run.vertices) for run in source.cells) == len(tets)
            reads.append(reader(form, path))
            writes.append(writer(form, path))
        reading, writing = least(reads, options.repeats), least(writes, options.repeats)
    table = Table("format", "to read [s]", "times VTK", "to write [s]", title=f"CPU for {len(tets):,} tets")
    for name, one, other in zip(chosen, reading, writing, strict=True):
        table.add_row(name, f"{one:.3f}", f"{one / reading[0]:.2f}", f"{other:.3f}")
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
