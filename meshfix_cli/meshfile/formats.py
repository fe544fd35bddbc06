"""Which format a file has: from its first bytes, then from its name."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

HEAD = 4096  # bytes that are enough to recognise a format

# Formats that a module of this package, of the same name, reads and writes back: meshio's names of the readers.
OWN = ("abaqus", "gmsh", "medit", "obj", "ply", "stl", "vtk", "vtu")
# Extensions that need not be looked up. `.msh` is gmsh's, whatever meshio's default is; a file that becomes one is of
# version 2.2, in which each element has its group: meshio's writer of 4.1 has one for each run of them.
_EXTENSIONS = {f".{name}": name for name in ("obj", "ply", "stl", "vtk", "vtu")} | {
    ".inp": "abaqus",
    ".mesh": "medit",
    ".msh": "gmsh22",
    ".pvtu": "pvtu",
}
ENDLESS = ("tecplot", "wkt")  # meshio reads truncated files of these for ever
BOTH = ("gmsh", "gmsh22", "ply", "stl", "vtk", "vtk42", "vtu")  # written as text or binary


@dataclass(frozen=True)
class Format:
    """A format by meshio's name of its writer, and whether the file is binary (None: the format has no choice)."""

    name: str
    binary: bool | None = None

    @property
    def reader(self) -> str:
        """meshio's name of the reader."""
        return {"gmsh22": "gmsh", "vtk42": "vtk"}.get(self.name, self.name)


PARTS = Format("gmsh parts")  # several files of gmsh


def sniff(data: bytes) -> Format | None:
    """Recognise a format by the first bytes of a file; None: unknown."""
    if len(data) >= 84 and len(data) == 84 + 50 * int.from_bytes(data[80:84], "little"):
        return Format("stl", True)
    head = data[:HEAD]
    text = head.decode("latin-1").lstrip("\ufeff\xef\xbb\xbf \t\r\n")
    if text.startswith("# vtk DataFile"):
        version = re.match(r"# vtk DataFile Version (\d+)", text)
        old = version is not None and int(version[1]) < 5
        lines = text.split("\n", 3) if "\n" in text else text.split("\r", 3)
        return Format("vtk42" if old else "vtk", len(lines) > 2 and lines[2].strip().upper() == "BINARY")
    if "$MeshFormat" in text:
        fields = text.split("$MeshFormat", 1)[1].split()
        return Format("gmsh22" if fields[:1] and fields[0].startswith("2") else "gmsh", fields[1:2] == ["1"])
    if text.startswith(("<?xml", "<VTKFile", "<Xdmf", "<dolfin")):
        if re.search(r"<VTKFile[^>]*\stype\s*=\s*[\"']PUnstructuredGrid", text):
            return Format("pvtu")
        if re.search(r"<VTKFile[^>]*\stype\s*=\s*[\"']UnstructuredGrid", text):
            return Format("vtu", re.search(r"format\s*=\s*[\"']ascii", text) is None)
        return Format("xdmf") if "<Xdmf" in text else Format("dolfin-xml") if "<dolfin" in text else None
    if text.startswith("ply"):
        return Format("ply", "format ascii" not in text)
    if re.match(r"solid\b.*\bfacet\b", text, re.IGNORECASE | re.DOTALL):
        return Format("stl", False)
    if re.match(r"(#.*\n\s*)*MeshVersionFormatted\b", text):
        return Format("medit")
    for start, name in (("OFF", "off"), ("NDIME", "su2")):
        if text.startswith(start):
            return Format(name)
    if re.match(r"\*(\*| *[A-Za-z]{3})", text):
        return Format("abaqus")
    if re.search(r"^v[ \t]+[-+.\d]", text, re.MULTILINE) and re.match(r"(#|[ogsv] |mtllib |usemtl )", text):
        return Format("obj")
    return None


def missing_part(data: bytes, form: Format, cells: int) -> str | None:
    """Say what a file announces but does not hold; meshio reads some truncated files without a word.

    `cells` is the number of cells that were read, or -1 before they are.
    """
    if form.name == "permas" and b"$FIN" not in data:
        return "it does not end with $FIN"
    if form.name == "mdpa" and len(re.findall(rb"(?m)^Begin ", data)) != len(re.findall(rb"(?m)^End ", data)):
        return "a block does not end"
    if cells < 0:
        return None
    found = re.search(rb"NELEM\s*=\s*(\d+)", data) if form.name == "su2" else None
    if found and cells < int(found[1]):
        return f"it announces {int(found[1]):,} cells and holds {cells:,}"
    return None


def by_name(path: Path) -> Format | None:
    """Recognise a format by the extension; None: unknown."""
    suffix = path.suffix.lower()
    if suffix in _EXTENSIONS:
        return Format(_EXTENSIONS[suffix])
    import meshio

    names = [name for name in meshio.extension_to_filetypes.get(suffix, []) if name not in ENDLESS]
    return Format(names[0]) if names else None


def writers() -> tuple[str, ...]:
    """Names of the formats that meshio reads, and writes to a single file."""
    import meshio

    both = set(meshio._helpers._writer_map) & set(meshio._helpers.reader_map)
    return tuple(sorted(both - {"tetgen", *ENDLESS} | {"gmsh22", "vtk42"}))


def options(form: Format) -> dict[str, object]:
    """Keyword arguments for meshio's writer."""
    if form.name == "xdmf":
        return {"data_format": "XML"}  # else the numbers go to a second file
    if form.name == "vtu":
        return {"binary": True}  # meshio's text has 12 digits, which would move fixed vertices
    return {} if form.binary is None else {"binary": form.binary}
