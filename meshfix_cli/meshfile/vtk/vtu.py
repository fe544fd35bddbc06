"""VTK's XML files of unstructured grids, .vtu, of one or several pieces; see `dataset`.

Source: VTK documentation, "VTK File Formats", section XML Formats.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.meshfile.source import Source
from meshfix_cli.meshfile.vtk import dataset
from meshfix_cli.meshfile.vtk.dataset import Cells, DataSet, Piece
from meshfix_cli.meshfile.vtk.xml import Element, XmlFile


def parse(data: bytes) -> Source:
    """Read points and cells of all pieces."""
    return dataset.parse(data, _GRID)


def promoted(data: bytes) -> bytes:
    """Return the file with coordinates in float64."""
    return dataset.promoted(data, _GRID)


def _counts(piece: Element) -> tuple[int, int]:
    return piece.count("NumberOfPoints"), piece.count("NumberOfCells")


def _cells(file: XmlFile, pieces: Sequence[Piece]) -> Cells:
    def types(piece: Piece, section: str, _: NDArray[np.int64]) -> NDArray[np.int64]:
        return dataset.integers(file, piece.only(section, "types"), piece.cells)

    return dataset.listed(file, ((piece, "Cells", piece.cells) for piece in pieces), types)


_GRID = DataSet("UnstructuredGrid", _counts, _cells)
