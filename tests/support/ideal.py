"""The ideal element of each type."""

from math import sqrt

# Regular elements, in gmsh's order; a pyramid whose corners at the base have edges like those of a cube's corner.
REGULAR: dict[str, list[tuple[float, ...]]] = {
    "line": [(0,), (1,)],
    "triangle": [(0, 0), (1, 0), (0.5, sqrt(3) / 2)],
    "quad": [(0, 0), (1, 0), (1, 1), (0, 1)],
    "tetra": [(0, 0, 0), (1, 1, 0), (0, 1, 1), (1, 0, 1)],
    "pyramid": [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0.5, sqrt(0.5))],
    "wedge": [(0, 0, 0), (1, 0, 0), (0.5, sqrt(3) / 2, 0), (0, 0, 1), (1, 0, 1), (0.5, sqrt(3) / 2, 1)],
    "hexahedron": [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)],
}
