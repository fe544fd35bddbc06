"""A box with cylindrical holes, meshed by gmsh: irregular tetrahedra in the order in which their mesher made them."""

from __future__ import annotations

import gmsh
import numpy as np

from meshfix_cli import Mesh

SIZE = (4.0, 2.0, 1.0)
HOLES = ((0.8, 0.6, 0.25), (0.8, 1.4, 0.2), (2.0, 1.0, 0.4), (3.2, 0.6, 0.2), (3.2, 1.4, 0.25))  # x, y, radius
TETS_H3 = 31.5  # tetrahedra times h^3, for gmsh's default algorithm


def box_with_holes(tets: int) -> Mesh:
    """Mesh it with about so many tetrahedra of one size."""
    h = (TETS_H3 / tets) ** (1 / 3)
    gmsh.model.add("box")
    try:
        box = gmsh.model.occ.addBox(0, 0, 0, *SIZE)
        holes = [(3, gmsh.model.occ.addCylinder(x, y, -0.5, 0, 0, 2, r)) for x, y, r in HOLES]
        gmsh.model.occ.cut([(3, box)], holes)
        gmsh.model.occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMin", h)
        gmsh.option.setNumber("Mesh.MeshSizeMax", h)
        gmsh.model.mesh.generate(3)
        tags, points, _ = gmsh.model.mesh.getNodes()
        corners = gmsh.model.mesh.getElementsByType(4)[1].reshape(-1, 4)
    finally:
        gmsh.model.remove()
    number = np.zeros(int(tags.max()) + 1, dtype=np.int32)
    number[tags.astype(np.int64)] = np.arange(len(tags), dtype=np.int32)
    return Mesh.build(points.reshape(-1, 3), number[corners.astype(np.int64)])
