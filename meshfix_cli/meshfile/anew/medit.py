"""MEDIT's text: points and elements, each with the number of its material.

Source: P. Frey, "MEDIT: an interactive mesh visualization software", INRIA RT-0253.
"""

from __future__ import annotations

import numpy as np

from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.meshfile.anew.content import Content
from meshfix_cli.meshfile.anew.tables import integers, lines
from meshfix_cli.meshfile.medit.sections import CELLS
from meshfix_cli.meshfile.recognise import Format

# Of types that have several names, the first; of those that are only held there is no order of nodes.
_SECTIONS = {key: name for name, (key, _) in reversed(CELLS.items()) if key in ELEMENTS}


def written(content: Content, _: Format) -> bytes:
    """Return a file; other groups than materials have no place in it."""
    points = np.asarray(content.points, dtype=np.float64)
    n, dimension = points.shape
    parts = [f"MeshVersionFormatted 2\nDimension {dimension}\n\nVertices\n{n}\n".encode()]
    parts.append(lines("%r " * dimension + "0\n", points))
    for i, run in enumerate(content.cells):
        m = len(run.vertices)
        if run.type in _SECTIONS and m:
            labels = np.zeros(m, dtype=np.int64) if content.regions is None else content.regions[i]
            parts.append(f"\n{_SECTIONS[run.type]}\n{m}\n".encode())
            parts.append(integers(run.vertices + 1, labels))
    return b"".join([*parts, b"\nEnd\n"])
