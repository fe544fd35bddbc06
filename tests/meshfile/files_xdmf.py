"""XDMF files in one piece, with all numbers in the XML, as meshio and FEniCS write them; read again by ElementTree."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import shapes
from files_medit import material, surface
from numpy.typing import NDArray

HEAD = '<?xml version="1.0"?>\n<!DOCTYPE Xdmf SYSTEM "Xdmf.dtd" []>\n'
NAMES = {2: "PolyLine", 3: "Triangle", 4: "Tetrahedron"}


def text(values: NDArray[Any]) -> str:
    return "\n".join(
        " ".join(f"{x:.6f}" if values.dtype.kind == "f" else str(x) for x in row) for row in values.tolist()
    )


def item(values: NDArray[Any], attributes: str = 'Format="XML"') -> str:
    kind = "Float" if values.dtype.kind == "f" else "Int"
    table = values if values.ndim == 2 else values[:, None]
    shape = " ".join(map(str, values.shape))
    end = "\n" if kind == "Float" else ""  # the last number may touch what follows
    return (
        f'<DataItem Dimensions="{shape}" NumberType="{kind}" Precision="8" {attributes}>\n{text(table)}{end}</DataItem>'
    )


def topology(cells: NDArray[Any]) -> str:
    m, k = cells.shape
    return f'<Topology TopologyType="{NAMES[k]}" NumberOfElements="{m}" NodesPerElement="{k}">{item(cells)}</Topology>'


def attribute(name: str, values: NDArray[Any], center: str = "Cell") -> str:
    return f'<Attribute Name="{name}" AttributeType="Scalar" Center="{center}">{item(values)}</Attribute>'


def tags(name: str, cells: NDArray[Any], values: NDArray[Any]) -> str:
    return (
        f'<Grid Name="{name}" GridType="Uniform"><xi:include xpointer="xpointer(/Xdmf/Domain/Grid/Geometry)" />'
        f"{topology(cells)}{attribute(name, values)}</Grid>\n"
    )


def dolfinx(path: Path) -> None:
    """A mesh, and tags of its cells, in another order, and of its boundary, of which each refers to its points."""
    points, cells = shapes.block()
    order = np.random.default_rng(1).permutation(len(cells))
    path.write_text(
        HEAD + '<Xdmf Version="3.0" xmlns:xi="https://www.w3.org/2001/XInclude">\n<Domain>\n<Grid Name="mesh" '
        f'GridType="Uniform">{topology(cells)}\n<Geometry GeometryType="XYZ">{item(points)}</Geometry></Grid>\n'
        + tags("labels", cells[order], material(points, cells)[order])
        + tags("facets", surface(cells), np.arange(len(surface(cells))) % 4)
        + "</Domain>\n</Xdmf>\n"
    )


def meshio(path: Path) -> None:
    import meshio

    points, cells = shapes.block()
    data = {"gmsh:physical": [np.arange(len(surface(cells))) // 50, material(points, cells)]}
    blocks = [("triangle", surface(cells)), ("tetra", cells)]  # so it is a mixed topology
    meshio.Mesh(points, blocks, {"T": points.sum(axis=1)}, data).write(path, "xdmf", data_format="XML")


def series(path: Path) -> None:
    """Steps in time of a plane mesh, by meshio, which refer to a grid of the name."""
    import meshio

    points, cells = shapes.plate()
    with meshio.xdmf.TimeSeriesWriter(path, data_format="XML") as writer:
        writer.write_points_cells(points[:, :2], [("triangle", cells)])
        for time in (0.0, 0.5):
            writer.write_data(time, point_data={"T": points[:, 0] + time}, cell_data={"a": [np.arange(len(cells))]})


def columns(path: Path) -> None:
    """Coordinates apart, comments, and sets."""
    points, cells = shapes.block()
    path.write_text(
        '<Xdmf Version="2.0"><!-- by hand --><Domain><Grid Name="it"><Topology Type="Tetrahedron" '
        f'Dimensions="{len(cells)}">{item(cells)}</Topology><Geometry Type="X_Y_Z">'
        + "".join(item(column) for column in points.T)
        + f'</Geometry><Set Name="wall" SetType="Node">{item(np.unique(surface(cells)))}</Set>'
        f'<Set Name="some" SetType="Cell">{item(np.arange(0, 40, 3))}</Set></Grid></Domain></Xdmf>'
    )


def single(path: Path) -> None:
    points, cells = shapes.plate()
    numbers = item(points[:, :2]).replace('Precision="8"', 'Precision="4"')
    path.write_text(
        f'<Xdmf><Domain><Grid><Geometry GeometryType="XY">{numbers}</Geometry>{topology(cells)}</Grid></Domain></Xdmf>'
    )


def stored(folder: Path, **options: Any) -> Path:
    """As FEniCS writes meshes: all numbers in one file of HDF5, with tags of facets."""
    import h5py

    points, cells = shapes.block()
    skin = surface(cells)
    with h5py.File(folder / "in.h5", "w") as file:
        file.create_dataset("Mesh/mesh/geometry", data=points, **options)
        file.create_dataset("Mesh/mesh/topology", data=cells)
        file.create_dataset("MeshTags/facets/topology", data=skin)
        file.create_dataset("MeshTags/facets/Values", data=np.arange(len(skin)))
        file["MeshTags"].attrs["partition"] = 0
    path = folder / "in.xdmf"
    path.write_text(
        HEAD + '<Xdmf Version="3.0" xmlns:xi="https://www.w3.org/2001/XInclude"><Domain><Grid Name="mesh">'
        f'<Topology TopologyType="Tetrahedron" NumberOfElements="{len(cells)}" NodesPerElement="4">'
        f'<DataItem Dimensions="{len(cells)} 4" NumberType="Int" Format="HDF">in.h5:/Mesh/mesh/topology</DataItem>'
        f'</Topology><Geometry GeometryType="XYZ"><DataItem Dimensions="{len(points)} 3" Format="HDF">'
        "\n  in.h5:/Mesh/mesh/geometry\n</DataItem></Geometry></Grid>\n"
        '<Grid Name="facets"><xi:include xpointer="xpointer(/Xdmf/Domain/Grid/Geometry)"/>'
        f'<Topology TopologyType="Triangle"><DataItem Dimensions="{len(skin)} 3" NumberType="Int" Format="HDF">'
        'in.h5:/MeshTags/facets/topology</DataItem></Topology><Attribute Name="facets" Center="Cell">'
        f'<DataItem Dimensions="{len(skin)} 1" Format="HDF">in.h5:/MeshTags/facets/Values</DataItem>'
        "</Attribute></Grid></Domain></Xdmf>"
    )
    return path


FILES: dict[str, Callable[[Path], None]] = {
    "dolfinx.xdmf": dolfinx,
    "meshio.xdmf": meshio,
    "series.xdmf": series,
    "columns.xdmf": columns,
    "single.xdmf": single,
}


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Points (n, 3), and all other elements and texts."""
    root = ElementTree.fromstring(path.read_text())
    geometry = next(one for one in root.iter("Geometry") if len(one))
    parts = [np.array((one.text or "").split(), dtype=float) for one in geometry]
    if any(one.get("Precision") == "4" for one in geometry):
        parts = [part.astype(np.float32).astype(float) for part in parts]
    kind = geometry.get("GeometryType") or geometry.get("Type") or ""
    table = np.column_stack(parts) if "_" in kind else parts[0].reshape(-1, len(kind))
    rest: dict[str, Any] = {}
    of_points = set(geometry)
    for number, one in enumerate(root.iter()):
        kept = {name: value for name, value in one.attrib.items() if one not in of_points or name != "Precision"}
        rest[f"{number} {one.tag}"] = (kept, None if one in of_points else (one.text or "").split())
    return np.column_stack([table, np.zeros((len(table), 3 - table.shape[1]))]), rest
