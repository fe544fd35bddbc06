"""Meshes of DOLFIN in XML as it and others write them, and a reader by another parser."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import shapes
from files_medit import material
from numpy.typing import NDArray

TYPES = {3: "triangle", 4: "tetrahedron"}


def text(
    points: NDArray[np.float64], cells: NDArray[np.int64], coordinates: str = "", kind: str = "", behind: str = ""
) -> str:
    d = cells.shape[1] - 1
    kind = kind or TYPES[cells.shape[1]]
    names = coordinates or "xyz"[:d]
    vertices = "".join(
        f'      <vertex index="{i}" {" ".join(f"""{a}="{x:.6f}" """ for a, x in zip(names, p, strict=False))}/>\n'
        for i, p in enumerate(points)
    )
    rows = "".join(
        f'      <{kind} index="{i}" {" ".join(f"""v{k}="{v}" """ for k, v in enumerate(c))}/>\n'
        for i, c in enumerate(cells.tolist())
    )
    return (
        f'<?xml version="1.0" encoding="UTF-8"?>\n\n<dolfin xmlns:dolfin="http://www.fenicsproject.org">\n'
        f'  <mesh celltype="{kind}" dim="{d}">\n    <vertices size="{len(points)}">\n{vertices}    </vertices>\n'
        f'    <cells size="{len(cells)}">\n{rows}    </cells>\n{behind}  </mesh>\n</dolfin>\n'
    )


def plane(path: Path) -> None:
    path.write_text(text(*shapes.plate()))


def domains(path: Path) -> None:
    """Regions of cells, marks of facets, comments that look like vertices, cells whose vertices ascend."""
    points, cells = shapes.block()
    marks = material(points, cells)
    values = "".join(
        f'        <value cell_index="{i}" local_entity="0" value="{mark}" />\n' for i, mark in enumerate(marks)
    )
    behind = (
        f'    <domains>\n      <mesh_value_collection name="m" type="uint" dim="3" size="{len(cells)}">\n{values}'
        '      </mesh_value_collection>\n      <mesh_value_collection type="uint" dim="2" size="1">\n'
        '        <value cell_index="0" local_entity="1" value="5" />\n      </mesh_value_collection>\n'
        '    <!-- <vertices size="1"><vertex index="0" x="1" y="2"/></vertices> -->\n    </domains>\n'
    )
    path.write_text(
        text(points, np.sort(cells, axis=1), behind=behind).replace("</vertices>", "<!-- <v/> --></vertices>", 1)
    )


def unordered(path: Path) -> None:
    """By hand: both kinds of quotes, attributes in another order, a third coordinate, no order of vertices."""
    points, cells = shapes.plate()
    order = np.random.default_rng(3).permutation(len(points))
    vertices = " ".join(
        f"<vertex y = '{points[i, 1]:.6f}' z='0' x=\"{points[i, 0]:.6f}\" index='{i}' ></vertex>" for i in order
    )
    rows = "\n".join(f"<triangle v2='{c}' v0='{a}'\n v1='{b}' index='{i}'/>" for i, (a, b, c) in enumerate(cells))
    path.write_text(
        "<dolfin><mesh dim='2'\ncelltype='triangle' >"
        f"<vertices size='{len(points)}'>{vertices}</vertices><cells size='{len(cells)}'>{rows}</cells></mesh></dolfin>"
    )


FILES: dict[str, Callable[[Path], None]] = {"plane.xml": plane, "domains.xml": domains, "unordered.xml": unordered}


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Points (n, 3) in the order of the file, and all else in its elements."""
    points, rest = [], []
    for element in ElementTree.parse(path).iter():
        others = dict(element.attrib)
        if element.tag == "vertex":
            points.append([float(others.pop(name, "0")) for name in "xyz"])
        rest.append((element.tag, others))
    return np.array(points), {"elements": rest}
