"""Which format a file has: from its first bytes, then from its name."""

from __future__ import annotations

import mmap
import re
from dataclasses import dataclass
from pathlib import Path

HEAD = 4096  # bytes that are enough to recognise a format


@dataclass(frozen=True)
class Format:
    """A format by meshio's name of its writer, and whether the file is binary (None: the format has no choice)."""

    name: str
    binary: bool | None = None

    @property
    def reader(self) -> str:
        """meshio's name of the reader."""
        return {"gmsh22": "gmsh", "vtk42": "vtk"}.get(self.name, self.name)


def sniff(head: bytes) -> Format | None:
    """Recognise a format by the first bytes of a file; None: unknown."""
    text = head.decode("latin-1").lstrip("\ufeff\xef\xbb\xbf \t\r\n")
    if text.startswith("# vtk DataFile"):
        version = re.match(r"# vtk DataFile Version (\d+)", text)
        old = version is not None and int(version[1]) < 5
        lines = text.splitlines()
        return Format("vtk42" if old else "vtk", len(lines) > 2 and lines[2].strip().upper() == "BINARY")
    if "$MeshFormat" in text:
        fields = text.split("$MeshFormat", 1)[1].split()
        return Format("gmsh22" if fields[:1] and fields[0].startswith("2") else "gmsh", fields[1:2] == ["1"])
    if text.startswith(("<?xml", "<VTKFile", "<Xdmf", "<dolfin")):
        if "<VTKFile" in text:
            return Format("vtu", 'format="ascii"' not in text)
        return Format("xdmf") if "<Xdmf" in text else Format("dolfin-xml") if "<dolfin" in text else None
    if text.startswith("ply"):
        return Format("ply", "format ascii" not in text)
    if text.startswith("solid") and "facet" in text:
        return Format("stl", False)
    for start, name in (("MeshVersionFormatted", "medit"), ("OFF", "off"), ("NDIME", "su2")):
        if text.startswith(start):
            return Format(name)
    if re.match(r"\*(heading|node|part|\*)", text, re.IGNORECASE):
        return Format("abaqus")
    if re.search(r"^v[ \t]+[-+.\d]", text, re.MULTILINE) and re.match(r"(#|o |g |v |mtllib )", text):
        return Format("obj")
    return None


def missing_part(path: Path, form: Format, cells: int) -> str | None:
    """Say what a file announces but does not hold; meshio reads some truncated files without a word.

    `cells` is the number of cells that were read.
    """
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        if form.reader == "gmsh":
            for section in (b"Nodes", b"Elements"):
                if data.find(b"$" + section) >= 0 > data.find(b"$End" + section):
                    return f"the section ${section.decode()} does not end"
        start = data.find(b"\nCELLS ") if form.reader == "vtk" else -1
        if start >= 0:
            announced = int(data[start + 7 : start + 40].split()[0]) - (form.name == "vtk")
            if announced != cells:
                return f"it announces {announced:,} cells and holds {cells:,}"
        least = {"ply": rb"element face (\d+)", "su2": rb"NELEM\s*=\s*(\d+)"}.get(form.name)
        found = re.search(least, data) if least else None
        if found and cells < int(found[1]):
            return f"it announces {int(found[1]):,} cells and holds {cells:,}"
    return None


def by_name(path: Path) -> Format | None:
    """Recognise a format by the extension; None: unknown. `.msh` is gmsh's, whatever meshio's default is."""
    import meshio

    names = meshio.extension_to_filetypes.get(path.suffix.lower(), [])
    if not names:
        return None
    return Format("gmsh" if "gmsh" in names else names[0])


def writers() -> tuple[str, ...]:
    """Names of the formats that meshio reads, and writes to a single file."""
    import meshio

    both = set(meshio._helpers._writer_map) & set(meshio._helpers.reader_map)
    return tuple(sorted(both - {"tetgen"} | {"gmsh22", "vtk42"}))


def options(form: Format) -> dict[str, object]:
    """Keyword arguments for meshio's writer."""
    if form.name == "xdmf":
        return {"data_format": "XML"}  # else the numbers go to a second file
    if form.name == "vtu":
        return {"binary": True}  # meshio's text has 12 digits, which would move fixed vertices
    return {} if form.binary is None else {"binary": form.binary}
