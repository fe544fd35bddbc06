"""Files of FEBio as its versions write them, and a reader of our own, by the XML parser of Python."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapes
from files_medit import material, surface
from numpy.typing import NDArray


def rows(form: str, listed: Sequence[Sequence[object]], first: int = 1) -> str:
    """An XML element for each, by its name and what is between its numbers."""
    tag, _, between = form.partition(" ")
    lines = [f'<{tag} id="{i}">{between.join(map(str, row))}</{tag}>\n' for i, row in enumerate(listed, first)]
    return "".join(f"\t\t\t{line}" for line in lines)


def nodes(points: NDArray[np.float64], between: str = ",", name: str = ' name="Object1"') -> str:
    return f"\t\t<Nodes{name}>\n{rows(f'node {between}', points.tolist())}\t\t</Nodes>\n"


def elements(about: str, listed: Sequence[Sequence[int]], first: int = 1, tag: str = "elem") -> str:
    return f"\t\t<Elements {about}>\n{rows(f'{tag} ,', listed, first)}\t\t</Elements>\n"


def file(*sections: str, version: str = "4.0", mesh: str = "Mesh", behind: str = "") -> str:
    head = f'<?xml version="1.0" encoding="ISO-8859-1"?>\n<febio_spec version="{version}">\n\t<Module type="solid"/>\n'
    return f"{head}\t<{mesh}>\n{''.join(sections)}\t</{mesh}>\n{behind}</febio_spec>\n"


def newer(path: Path) -> None:
    """Two parts of a material each; a surface, and sets as numbers."""
    points, cells = shapes.block()
    parts, skin, at, listed = material(points, cells), surface(cells), 1, [nodes(points)]
    for part, name in ((1, "below"), (2, "above")):
        mine = (cells[parts == part] + 1).tolist()
        listed.append(elements(f'type="tet4" name="{name}"', mine, at))
        at += len(mine)
    listed += ['\t\t<NodeSet name="tips">1,2,\n3</NodeSet>\n<ElementSet name="some">\n1,2\n</ElementSet>\n']
    listed += [f'\t\t<Surface name="skin">\n{rows("tri3 ,", (skin + 1).tolist())}\t\t</Surface>\n']
    domains = '\t<MeshDomains>\n\t\t<SolidDomain name="below" mat="a"/>\n\t\t<SolidDomain name="above" mat="b"/>\n'
    path.write_text(file(*listed, behind=domains + "\t</MeshDomains>\n<!-- the end -->\n"))


def older(path: Path) -> None:
    """Names of types, blanks behind commas, and sets of XML elements; lines that end as on Windows."""
    points, cells = shapes.block()
    parts, at, listed = material(points, cells), 1, [nodes(points, ", ", "")]
    for part in (1, 2):
        mine = (cells[parts == part] + 1).tolist()
        listed.append(elements(f'type="tet4" mat="{part}" elset="part {part}"', mine, at))
        at += len(mine)
    listed += ['<NodeSet name="tips">\n<node id="1"/>\n<node id="2"/>\n</NodeSet>\n']
    path.write_bytes(file(*listed, version="2.5", mesh="Geometry").replace("\n", "\r\n").encode())


FILES: dict[str, Callable[[Path], None]] = {"newer.feb": newer, "older.feb": older}


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Points (n, 3), and all other texts."""
    root = ET.parse(path).getroot()
    found = [one for part in root.iter("Nodes") for one in part.iter("node")]
    points = np.array([list(map(float, (one.text or "").split(","))) for one in found])
    for one in found:
        one.text = ""
    return points, {"rest": ET.tostring(root)}
