"""MEDIT's text: points and elements, each with the number of its material.

Source: P. Frey, "MEDIT: an interactive mesh visualization software", INRIA RT-0253.
"""

from __future__ import annotations

import numpy as np

from meshfix_cli.meshfile.anew.content import Content
from meshfix_cli.meshfile.anew.tables import form_of, lines
from meshfix_cli.meshfile.recognise import Format

_SECTIONS = {
    "line": "Edges", "triangle": "Triangles", "quad": "Quadrilaterals", "tetra": "Tetrahedra",
    "hexahedron": "Hexahedra", "wedge": "Prisms", "pyramid": "Pyramids", "line3": "EdgesP2", "triangle6": "TrianglesP2",
    "quad9": "QuadrilateralsQ2", "tetra10": "TetrahedraP2",
}  # fmt: skip


def written(content: Content, _: Format) -> bytes:
    """Return a file; other groups than materials have no place in it."""
    points = np.asarray(content.points, dtype=np.float64)
    n, dimension = points.shape
    parts = [f"MeshVersionFormatted 2\nDimension {dimension}\n\nVertices\n{n}\n".encode()]
    parts.append(lines(form_of(dimension, 1), points, np.zeros(n, dtype=np.int64)))
    for i, run in enumerate(content.cells):
        m = len(run.vertices)
        if run.type in _SECTIONS and m:
            labels = np.zeros(m, dtype=np.int64) if content.regions is None else content.regions[i]
            parts.append(f"\n{_SECTIONS[run.type]}\n{m}\n".encode())
            parts.append(lines(form_of(0, run.vertices.shape[1] + 1), run.vertices + 1, labels))
    return b"".join([*parts, b"\nEnd\n"])
