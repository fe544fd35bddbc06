"""What files of each format begin with: for each a function from the first bytes to a format, or None.

Each gets all bytes, and the first of them as text without blanks in front.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Format:
    """A format by meshio's name of its writer, and whether the file is binary (None: the format has no choice)."""

    name: str
    binary: bool | None = None

    @property
    def reader(self) -> str:
        """meshio's name of the reader."""
        return {"gmsh1": "gmsh", "gmsh22": "gmsh", "vtk42": "vtk"}.get(self.name, self.name)


_DYNA = re.compile(r"(?:\$[^\n]*\n\s*)*\*(?:KEYWORD|NODE[\s_%+-](?s:.*)\*ELEMENT_|PART\s|ELEMENT_)")


def lsdyna(_: bytes, text: str) -> Format | None:
    """Recognise keywords that Abaqus, which has * as well, has not."""
    return Format("lsdyna") if _DYNA.match(text.replace("\r", "\n")) else None


def abaqus(_: bytes, text: str) -> Format | None:
    """Recognise a comment or a keyword."""
    if text.startswith("* FLAC3D"):
        return None
    return Format("abaqus") if re.match(r"\*(\*| *[A-Za-z]{3})", text) else None


def gmsh(_: bytes, text: str) -> Format | None:
    """Recognise the header of a version, or the first section of version 1."""
    if "$MeshFormat" not in text:
        first = re.search(r"^\$(?:NO[DE]|Nodes|PhysicalNames)\b", text, re.MULTILINE)
        return Format("gmsh1", False) if first else None
    fields = text.split("$MeshFormat", 1)[1].split()
    return Format("gmsh22" if fields[:1] and fields[0].startswith("2") else "gmsh", fields[1:2] == ["1"])


def medit(_: bytes, text: str) -> Format | None:
    """Recognise the version."""
    return Format("medit") if re.match(r"(#.*\n\s*)*MeshVersionFormatted\b", text) else None


def meshb(data: bytes, _: str) -> Format | None:
    """Recognise the number 1, a version, and the keyword of the dimension."""
    head = rb"\x01\0\0\0[\x01-\x04]\0\0\0\x03\0\0\0|\0\0\0\x01\0\0\0[\x01-\x04]\0\0\0\x03"
    return Format("meshb") if re.match(head, data) else None


def obj(_: bytes, text: str) -> Format | None:
    """Recognise a vertex behind a comment, a name or a material."""
    vertices = re.search(r"^v[ \t]+[-+.\d]", text, re.MULTILINE)
    return Format("obj") if vertices and re.match(r"(#|[ogsv] |mtllib |usemtl )", text) else None


def ply(_: bytes, text: str) -> Format | None:
    """Recognise the first word, and text by the header."""
    return Format("ply", "format ascii" not in text) if text.startswith("ply") else None


def stl(data: bytes, text: str) -> Format | None:
    """Recognise a length that fits the count of facets, or the first facet of a text."""
    if len(data) >= 84 and len(data) == 84 + 50 * int.from_bytes(data[80:84], "little"):
        return Format("stl", True)
    return Format("stl", False) if re.match(r"solid\b.*\bfacet\b", text, re.IGNORECASE | re.DOTALL) else None


def vtk(_: bytes, text: str) -> Format | None:
    """Recognise the first line, and the version and the kind of the numbers behind it."""
    if not text.startswith("# vtk DataFile"):
        return None
    version = re.match(r"# vtk DataFile Version (\d+)", text)
    old = version is not None and int(version[1]) < 5
    lines = text.split("\n", 3) if "\n" in text else text.split("\r", 3)
    return Format("vtk42" if old else "vtk", len(lines) > 2 and lines[2].strip().upper() == "BINARY")


def _vtk_xml(text: str, kind: str) -> bool:
    return re.search(rf"<VTKFile[^>]*\stype\s*=\s*[\"']{kind}", text) is not None


def of_vtk(kind: str, form: str) -> Callable[[bytes, str], Format | None]:
    """Return what recognises an XML file of VTK by the type of its data set."""

    def recognise(_: bytes, text: str) -> Format | None:
        if not (_is_xml(text) and _vtk_xml(text, kind)):
            return None
        return Format(form, re.search(r"format\s*=\s*[\"']ascii", text) is None)

    return recognise


def vts(data: bytes, text: str) -> Format | None:
    """Recognise structured grids, and those without points, which are refused by their names."""
    if _is_xml(text) and _vtk_xml(text, "P?(?:ImageData|RectilinearGrid)"):
        return Format("vts")
    return of_vtk("StructuredGrid", "vts")(data, text)


def names_pieces(kind: str, form: str) -> Callable[[bytes, str], Format | None]:
    """Return what recognises an XML file of VTK that names others."""
    return lambda _, text: Format(form) if _is_xml(text) and _vtk_xml(text, f"(?:{kind})") else None


def su2(_: bytes, text: str) -> Format | None:
    """Recognise the first keyword behind comments."""
    return Format("su2") if re.match(r"(?:%[^\n]*\n\s*)*(?:NDIME|NZONE|NELEM|NPOIN|IZONE)\s*=", text) else None


def openfoam(_: bytes, text: str) -> Format | None:
    """Recognise the header."""
    return Format("openfoam") if re.search(r"^FoamFile\s*\{", text, re.MULTILINE) else None


def by_extension(_: bytes, __: str) -> Format | None:
    """Numbers alone tell nothing."""
    return None


def in_hdf5(name: bytes, form: str) -> Callable[[bytes, str], Format | None]:
    """Return what recognises a file of HDF5 by the name of a group that only this format has."""

    def recognise(data: bytes, _: str) -> Format | None:
        begins = any(data.startswith(b"\x89HDF\r\n\x1a\n", at) for at in (0, 512, 1024, 2048))
        return Format(form) if begins and name in data else None

    return recognise


def xdmf(_: bytes, text: str) -> Format | None:
    """Recognise the root."""
    return Format("xdmf") if _is_xml(text) and "<Xdmf" in text else None


def exodus(data: bytes, text: str) -> Format | None:
    """Recognise netCDF, or the name of an attribute in HDF5."""
    if data[:4] in (b"CDF\1", b"CDF\2", b"CDF\5"):
        return Format("exodus")
    return in_hdf5(b"floating_point_word_size", "exodus")(data, text)


def exotxt(_: bytes, text: str) -> Format | None:
    """Recognise the first heading."""
    return Format("exotxt") if text.startswith("! Database Title") else None


def cgns(data: bytes, text: str) -> Format | None:
    """Recognise the name of a node in HDF5, or what was there before HDF5."""
    old = data[4:24] == b"ADF Database Version"  # what CGNS had before HDF5
    return Format("cgns") if old else in_hdf5(b"CGNSLibraryVersion", "cgns")(data, text)


def off(_: bytes, text: str) -> Format | None:
    """Recognise the keyword behind comments."""
    return Format("off") if re.match(r"(?:#[^\n]*\n\s*)*(?:ST)?C?N?4?n?OFF(?![A-Za-z])", text) else None


def mfem(_: bytes, text: str) -> Format | None:
    """Recognise the first line."""
    return Format("mfem") if re.match(r"MFEM (?:\w+ )?mesh v", text) else None


def mdpa(_: bytes, text: str) -> Format | None:
    """Recognise the beginning of a block behind comments."""
    return Format("mdpa") if re.match(r"(?://[^\n]*\n\s*)*Begin[ \t]+[A-Z]\w+", text) else None


def dolfin(_: bytes, text: str) -> Format | None:
    """Recognise the root."""
    return Format("dolfin-xml") if _is_xml(text) and "<dolfin" in text else None


_CARD = re.compile(r"(?mi)^(?:BEGIN[ \t,]+BULK\b|CEND\s*$|(?:GRID|CTRIA3|CQUAD4|CTETRA|CHEXA)\*?[ \t,]+\d+[ \t,])")


def nastran(_: bytes, text: str) -> Format | None:
    """Recognise the beginning of bulk data, or the first cards of a mesh."""
    return Format("nastran") if _CARD.search(text) else None


# A line of five counts, behind comments, and the first point; or the first step of several. With four, as some write,
# it may be one of TetGen.
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_UCD = re.compile(
    rf"(?:#[^\n]*\n\s*)*(?:(?:\d+[ \t]+){{4}}\d+\s*[\r\n]\s*\d+(?:[ \t]+{_NUMBER}){{3}}\s*[\r\n]"
    r"|\d+\s+(?:data|geom|data_geom)\s+step\d+)"
)


def avsucd(_: bytes, text: str) -> Format | None:
    """Recognise what may be called .inp, as files of Abaqus are."""
    return Format("avsucd") if _UCD.match(text) else None


def unv(_: bytes, text: str) -> Format | None:
    """Recognise the beginning of a data set."""
    return Format("unv") if re.match(r"-1[ \t]*[\r\n]\s*\d{2,4}[ \t]*[\r\n]", text) else None


def tecplot(data: bytes, text: str) -> Format | None:
    """Recognise the keywords of the header, or the first bytes of a binary file."""
    first = re.match(r"(?i)(?:#[^\n]*\n\s*)*(?:TITLE|VARIABLES|FILETYPE)\s*=", text)
    named = first and re.search(r"(?im)^[ \t]*VARIABLES\s*=", text)
    return Format("tecplot") if named or data.startswith(b"#!TD") else None


def comsol(_: bytes, text: str) -> Format | None:
    """Recognise the version of the file, and what its objects are."""
    head = re.match(r"(?:#[^\n]*\n\s*)*0[ \t]+1\s", text)
    made = text.startswith("# Created by COMSOL") or re.search(r"(?m)^\s*4 Mesh\b", text)
    return Format("comsol") if head and made else None


def gambit(_: bytes, text: str) -> Format | None:
    """Recognise the first line."""
    return Format("gambit") if text.startswith("CONTROL INFO") else None


def fluent(_: bytes, text: str) -> Format | None:
    """Recognise the first section by its number."""
    return Format("fluent") if re.match(r"\(\s*\d+\s+[\"'(\d]", text) else None


def byu(_: bytes, text: str) -> Format | None:
    """Recognise four counts, the ranges of polygons of as many parts as the first says, and a coordinate."""
    words = text[:4000].split()
    counts = [int(word) for word in words[:4] if re.fullmatch(r"\d{1,9}", word)]
    if len(counts) < 4 or not 1 <= counts[0] <= 200 or counts[3] < counts[2]:
        return None
    ranges = words[4 : 4 + 2 * counts[0]]
    if len(ranges) < 2 * counts[0] or not all(re.fullmatch(r"\d{1,9}", word) for word in ranges):
        return None
    pairs = zip(map(int, ranges[::2]), map(int, ranges[1::2]), strict=True)
    inside = all(1 <= first <= last <= counts[2] for first, last in pairs)
    return Format("byu") if inside and "." in "".join(words[4 + 2 * counts[0] :][:1]) else None


_MAPDL = re.compile(
    r"(?i)(?:!.*\n\s*)*(?:/(?:COM|PREP7|BATCH|NOPR|TITLE|CLEAR|UNITS|CONFIG|GO)\b|FINI(?:SH)?\s|ET\s*,\s*\d)"
)


def mapdl(_: bytes, text: str) -> Format | None:
    """Recognise the first command behind comments, or a block of nodes."""
    lines = text.replace("\r", "\n")
    block = re.search(r"(?im)^[ \t]*NBLOCK[ \t]*,[ \t]*\d", lines)
    return Format("mapdl") if block or _MAPDL.match(lines) else None


def netgen(_: bytes, text: str) -> Format | None:
    """Recognise the first keyword behind comments."""
    return Format("netgen") if re.match(r"(?:#[^\r\n]*\s*)*mesh3d[ \t]*[\r\n]", text) else None


# Three counts, and two vertices of two or three coordinates and a label.
_FREEFEM = re.compile(
    rf"(\d+)[ \t]+(\d+)[ \t]+(\d+)[ \t]*[\r\n]\s*"
    rf"((?:{_NUMBER}[ \t]+){{2,3}}-?\d+[ \t]*[\r\n]\s*(?:{_NUMBER}[ \t]+){{2,3}}-?\d+[ \t]*[\r\n])"
)


def freefem(data: bytes, text: str) -> Format | None:
    """Recognise the counts and the first vertices; where all of these are integers, also by the number of lines."""
    head = _FREEFEM.match(text)
    width = len(head[4].split()) // 2 if head else 0
    if head is None or int(head[1]) < 3 or (width == 3 and int(head[3]) == 0):  # no boundary: one of Geomview
        return None
    if "." in head[4]:
        return Format("freefem")
    numbered = [line.split()[0] for line in head[4].split("\n" if "\n" in head[4] else "\r")[:2]]
    elements = numbered in (["0", "1"], ["1", "2"]) and width == 1 + int(head[2]) + int(head[3])  # Triangle's
    breaks = max(data.count(b"\n"), data.count(b"\r"))
    return None if elements or breaks < sum(int(head[i]) for i in (1, 2, 3)) else Format("freefem")


_UGRID = re.compile(rf"(?:\d+[ \t]+){{6}}\d+[ \t]*[\r\n]\s*(?:{_NUMBER}[ \t]+){{2}}{_NUMBER}[ \t]*[\r\n]")


def ugrid(data: bytes, text: str) -> Format | None:
    """Recognise seven counts and the first node, or a length that fits such counts."""
    if _UGRID.match(text):
        return Format("ugrid", False)
    if b"\0" not in data[:64]:
        return None
    from meshfix_cli.meshfile.ugrid_layout import binary

    return Format("ugrid", True) if binary(data) else None


# A title, two counts, and two lines of a number and three more; behind these another word may stand.
_ADCIRC = re.compile(
    r"(?:[^\n]*\n)?\s*(\d+)[ \t]+(\d+)(?:[ \t]+[^-+.\d\s][^\n]*)?[ \t]*\n"
    rf"(?:\s*\d+(?:[ \t]+{_NUMBER}){{3}}(?:[ \t][^\n]*)?\n){{2}}"
)


def adcirc(_: bytes, text: str) -> Format | None:
    """Recognise the counts and the first nodes."""
    head = _ADCIRC.match(text.replace("\r\n", "\n").replace("\r", "\n"))
    return Format("adcirc") if head and int(head[2]) >= 3 and 1 <= int(head[1]) <= 2 * int(head[2]) else None


def febio(_: bytes, text: str) -> Format | None:
    """Recognise the root."""
    return Format("febio") if text.startswith("<") and re.search(r"<febio_spec\b", text) else None


def getfem(_: bytes, text: str) -> Format | None:
    """Recognise a comment, or the list of points."""
    begin = r"(?:%[^\r\n]*\s*)*(?:% GETFEM MESH|BEGIN POINTS LIST)"
    return Format("getfem") if re.match(begin, text) or text.startswith("% GETFEM") else None


def _is_xml(text: str) -> bool:
    return text.startswith(("<?xml", "<VTKFile", "<Xdmf", "<!DOCTYPE", "<dolfin"))
