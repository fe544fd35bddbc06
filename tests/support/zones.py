"""Several meshes in one file, in the ways that formats have for it: a reader may lay them over one another or miss one.

Each writer takes the files of the meshes alone, and puts both into a third.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path


def after_one_another(one: Path, other: Path, both: Path) -> None:
    both.write_bytes(one.read_bytes() + other.read_bytes())


def numbered_zones(one: Path, other: Path, both: Path) -> None:
    texts = [f"IZONE= {i}\n{path.read_text()}" for i, path in enumerate((one, other), 1)]
    both.write_text("".join(["NZONE= 2\n", *texts]))


def in_the_same(begin: str, end: str, head: str = "", tail: str = "") -> Callable[[Path, Path, Path], None]:
    """Put what is between two words of the second file behind that of the first, each with a head and a tail."""

    def write(one: Path, other: Path, both: Path) -> None:
        pattern = re.compile(f"{begin}.*{end}", re.DOTALL)
        found = [head + pattern.search(path.read_text())[0] + tail for path in (one, other)]  # type: ignore[index]
        both.write_text(pattern.sub(lambda _: "".join(found), one.read_text()))

    return write


def beside(above: str, name: str, other_name: str) -> Callable[[Path, Path, Path], None]:
    """Copy a group of the second file of HDF5 beside that of the first."""

    def write(one: Path, other: Path, both: Path) -> None:
        import h5py

        both.write_bytes(one.read_bytes())
        with h5py.File(both, "r+") as file, h5py.File(other) as second:
            second.copy(f"{above}/{name}", file[above], name=other_name)

    return write


# By the name of the file of each mesh alone.
ZONES: list[tuple[str, Callable[[Path, Path, Path], None]]] = [
    *[
        (name, after_one_another)
        for name in (
            "gmsh22.msh", "gmsh41.msh", "old.vtk", "single.vtk", "binary.vtu", "abaqus.inp", "medit.mesh", "text.ply",
            "binary.ply", "text.stl", "through.avs", "through.f3grid", "through.mdpa", "through.off",
             "through.post", "through.su2", "through.vol", "through.xdmf", "through.xml",
        )
    ],
    ("through.su2", numbered_zones),
    ("through.bdf", in_the_same("GRID", "(?=ENDDATA)", "BEGIN SUPER=1\n")),
    ("through.xdmf", in_the_same("<Grid", "</Grid>")),
    ("through.xdmf", in_the_same("<Grid", "</Grid>", "<Grid GridType='Collection'>", "</Grid>")),
    ("through.xdmf", in_the_same("<Domain", "</Domain>")),
    ("through.xml", in_the_same("<mesh", "</mesh>")),
    ("through.post", in_the_same("\\$ENTER COMPONENT", "\\$EXIT COMPONENT\n")),
    ("through.mdpa", in_the_same("Begin Nodes", "End Elements\n")),
    ("through.vol", in_the_same("dimension", "(?=endmesh|$)")),
    ("binary.vtu", in_the_same("<Piece", "</Piece>")),
    ("abaqus.inp", in_the_same("\\*NODE", "$", "*PART, NAME=A\n", "*END PART\n")),
]  # fmt: skip
if find_spec("h5py"):
    ZONES += [
        ("through.cgns", beside("/Base", "Zone1", "Zone2")),
        ("through.cgns", beside("/", "Base", "Base2")),
        ("through.hmf", beside("/domain", "grid", "grid2")),
        ("through.hmf", beside("/", "domain", "domain2")),
        ("through.med", beside("/ENS_MAA", "mesh", "mesh2")),
    ]
