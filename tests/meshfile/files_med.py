"""MED files as gmsh, meshio, Salome and older programs write them; h5py reads them back, data set by data set."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import shapes
from files_medit import material, surface, write_with_gmsh
from numpy.typing import NDArray

STEP = "-0000000000000000001-0000000000000000001"
# Which node of a tetrahedron of ours stands in each place.
MIRRORED = {"TE4": [0, 2, 1, 3], "TR3": [0, 1, 2], "SE2": [0, 1]}
ANY_PROFILE = "MED_NO_PROFILE_INTERNAL"


def gmsh_plane(path: Path) -> None:
    """Of tetrahedra gmsh renumbers those that are inverted."""
    write_with_gmsh(path, *shapes.plate())


def meshio(path: Path) -> None:
    """With data of points and cells; it does not mirror tetrahedra, which are so numbered the other way round."""
    import meshio

    points, cells = shapes.block()
    tags = {"cell_tags": [-5 - np.arange(len(surface(cells))) // 50, -material(points, cells)]}
    values = {"pressure": [np.arange(len(surface(cells))) / 8, np.arange(len(cells)) / 4]}
    blocks = [("triangle", surface(cells)), ("tetra", cells)]
    meshio.Mesh(
        points, blocks, {"point_tags": np.arange(len(points)) % 3, "T": points.sum(1)}, {**tags, **values}
    ).write(path)


def salome(path: Path) -> None:
    """Groups of nodes and cells, numbers of these, coordinates in chunks, and a field with two steps."""
    points, cells = shapes.block()
    skin, inner = surface(cells), material(points, cells)
    with _file(path) as file:
        nodes, types = _mesh(file, f"skin of it/{STEP}", points, 3)
        number = len(points)
        del nodes["COO"]
        nodes.create_dataset("COO", data=points.ravel("F"), chunks=(100,)).attrs["NBR"] = number
        nodes["FAM"] = np.where(np.isin(np.arange(number), skin), 1, 0)
        nodes["NUM"] = np.arange(number) * 2 + 1
        _cells(types, "TR3", skin, -2 - np.arange(len(skin)) % 2, np.arange(len(skin)) + 1)
        _cells(types, "TE4", cells, -3 - inner, np.arange(len(cells)) + 1001)
        families = file.create_group("FAS/skin of it")
        families.create_group("FAMILLE_ZERO").attrs["NUM"] = 0
        for kind, name, family, groups in (
            ("NOEUD", "FAM_1", 1, ["wall"]), ("ELEME", "FAM_-2", -2, ["even", "all of the skin, \xe9t\xe9"]),
            ("ELEME", "FAM_-3", -3, ["all of the skin, \xe9t\xe9"]), ("ELEME", "FAM_-4", -4, ["material"]),
        ):  # fmt: skip
            _family(families.create_group(f"{kind}/{name}"), family, groups)
        for step in (1, 2):
            values = file.create_group(f"CHA/velocity/{step:020d}{-1:020d}/NOE/{ANY_PROFILE}")
            values["CO"] = points.ravel("F") * step
            values.attrs["NBR"], values.attrs["NGA"] = number, 1
        file["CHA/velocity"].attrs["MAI"] = np.bytes_("skin of it")


def old(path: Path) -> None:
    """Version 2: no steps, integers of 32 bits, and families that stand beside one another."""
    points, cells = shapes.plate()
    with _file(path, 2) as file:
        _, types = _mesh(file, "plate", points, 2)
        _cells(types, "SE2", surface(cells).astype("i4"), np.full(len(surface(cells)), -1))
        _cells(types, "TR3", cells.astype("i4"), -6 - material(points, cells))
        families = file.create_group("FAS/plate")
        _family(families.create_group("FAM_-1_edge"), -1, ["edge"])
        _family(families.create_group("FAM_-7_plate"), -7, [])


def _file(path: Path, version: int = 4) -> Any:
    import h5py

    file = h5py.File(path, "w")
    information = file.create_group("INFOS_GENERALES")
    information.attrs["MAJ"], information.attrs["MIN"], information.attrs["REL"] = version, 0, 0
    return file


def _mesh(file: Any, within: str, points: NDArray[np.float64], dimension: int) -> tuple[Any, Any]:
    """The groups of nodes and of cells."""
    group = file.create_group(f"ENS_MAA/{within}")
    mesh = file["ENS_MAA"][within.partition("/")[0]]
    mesh.attrs["DIM"], mesh.attrs["ESP"], mesh.attrs["TYP"] = dimension, dimension, 0
    nodes = group.create_group("NOE")
    nodes["COO"] = points[:, :dimension].ravel("F")
    nodes["COO"].attrs["NBR"] = len(points)
    return nodes, group.create_group("MAI")


def _cells(
    types: Any, name: str, rows: NDArray[Any], families: NDArray[Any], numbers: NDArray[Any] | None = None
) -> None:
    group = types.create_group(name)
    group["NOD"] = (rows[:, MIRRORED[name]] + 1).ravel("F")
    group["NOD"].attrs["NBR"] = len(rows)
    group["FAM"] = families
    if numbers is not None:
        group["NUM"] = numbers


def _family(group: Any, number: int, groups: list[str]) -> None:
    group.attrs["NUM"] = number
    if groups:
        padded = [list(name.encode().ljust(80, b"\0")) for name in groups]
        kind = np.dtype(("i1", (80,)))
        group.create_dataset("GRO/NOM", (len(groups),), kind)[...] = np.array(padded, dtype=np.uint8).view("i1")
        group["GRO"].attrs["NBR"] = len(groups)


FILES: dict[str, Callable[[Path], None]] = {
    "gmsh_plane.med": gmsh_plane,
    "meshio.med": meshio,
    "salome.med": salome,
    "old.med": old,
}


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Points (n, 3), and all other data sets and attributes."""
    import h5py

    rest: dict[str, Any] = {}
    points = np.empty((0, 3))

    def visit(name: str, item: Any) -> None:
        nonlocal points
        rest[name] = {key: np.asarray(value) for key, value in item.attrs.items()}
        if name.endswith("NOE/COO"):
            table = item[()].reshape(-1, item.attrs["NBR"]).T
            points = np.column_stack([table, np.zeros((len(table), 3 - table.shape[1]))])
        elif isinstance(item, h5py.Dataset):
            rest[f"{name} "] = item[()]

    with h5py.File(path) as file:
        file.visititems(visit)
    return points, rest
