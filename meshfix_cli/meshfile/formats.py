"""Which format a file has: from its first bytes, then from its name."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from meshfix_cli.meshfile.compressed import inner

HEAD = 4096  # bytes that are enough to recognise a format

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
        return {"gmsh1": "gmsh", "gmsh22": "gmsh", "vtk42": "vtk"}.get(self.name, self.name)


DRAWINGS = ("obj", "off", "ply", "stl")  # these have no plane meshes, and their faces need not be elements
PARTS = Format("gmsh parts")  # several files of gmsh


@dataclass(frozen=True)
class Own:
    """A format that a module of this package reads and writes back.

    Attributes
    ----------
    module : str
        In `meshfix_cli.meshfile`; its docstring tells how the coordinates lie.
    recognise : callable
        (all bytes, the first of them as text without blanks in front) -> Format, or None where it is not this.
    extensions : dict
        The name of the `Format` that a file with this extension becomes.
    title : str
        What it is called; this and what follows is the row of the table in docs/files.md.
    reads : str
        Its variants, and what is not read.
    groups : str
        What its regions and groups are.
    extra : str
        What is to be installed to read it, and when.
    beside : bool
        A file may need others beside it: `parse` gets its path as well, or None.
    """

    module: str
    recognise: Callable[[bytes, str], Format | None]
    extensions: Mapping[str, str]
    title: str = ""
    reads: str = ""
    groups: str = ""
    extra: str = ""
    beside: bool = False


_DYNA = re.compile(r"(?:\$[^\n]*\n\s*)*\*(?:KEYWORD|NODE[\s_%+-](?s:.*)\*ELEMENT_|PART\s|ELEMENT_)")


def _lsdyna(_: bytes, text: str) -> Format | None:
    """Recognise keywords that Abaqus, which has * as well, has not."""
    return Format("lsdyna") if _DYNA.match(text.replace("\r", "\n")) else None


def _abaqus(_: bytes, text: str) -> Format | None:
    if text.startswith("* FLAC3D"):
        return None
    return Format("abaqus") if re.match(r"\*(\*| *[A-Za-z]{3})", text) else None


def _gmsh(_: bytes, text: str) -> Format | None:
    if "$MeshFormat" not in text:
        first = re.search(r"^\$(?:NO[DE]|Nodes|PhysicalNames)\b", text, re.MULTILINE)
        return Format("gmsh1", False) if first else None
    fields = text.split("$MeshFormat", 1)[1].split()
    return Format("gmsh22" if fields[:1] and fields[0].startswith("2") else "gmsh", fields[1:2] == ["1"])


def _medit(_: bytes, text: str) -> Format | None:
    return Format("medit") if re.match(r"(#.*\n\s*)*MeshVersionFormatted\b", text) else None


def _obj(_: bytes, text: str) -> Format | None:
    vertices = re.search(r"^v[ \t]+[-+.\d]", text, re.MULTILINE)
    return Format("obj") if vertices and re.match(r"(#|[ogsv] |mtllib |usemtl )", text) else None


def _ply(_: bytes, text: str) -> Format | None:
    return Format("ply", "format ascii" not in text) if text.startswith("ply") else None


def _stl(data: bytes, text: str) -> Format | None:
    if len(data) >= 84 and len(data) == 84 + 50 * int.from_bytes(data[80:84], "little"):
        return Format("stl", True)
    return Format("stl", False) if re.match(r"solid\b.*\bfacet\b", text, re.IGNORECASE | re.DOTALL) else None


def _vtk(_: bytes, text: str) -> Format | None:
    if not text.startswith("# vtk DataFile"):
        return None
    version = re.match(r"# vtk DataFile Version (\d+)", text)
    old = version is not None and int(version[1]) < 5
    lines = text.split("\n", 3) if "\n" in text else text.split("\r", 3)
    return Format("vtk42" if old else "vtk", len(lines) > 2 and lines[2].strip().upper() == "BINARY")


def _vtk_xml(text: str, kind: str) -> bool:
    return re.search(rf"<VTKFile[^>]*\stype\s*=\s*[\"']{kind}", text) is not None


def _vtu(_: bytes, text: str) -> Format | None:
    if not (_is_xml(text) and _vtk_xml(text, "UnstructuredGrid")):
        return None
    return Format("vtu", re.search(r"format\s*=\s*[\"']ascii", text) is None)


def _pvtu(_: bytes, text: str) -> Format | None:
    return Format("pvtu") if _is_xml(text) and _vtk_xml(text, "PUnstructuredGrid") else None


def _su2(_: bytes, text: str) -> Format | None:
    return Format("su2") if re.match(r"(?:%[^\n]*\n\s*)*(?:NDIME|NZONE|NELEM|NPOIN|IZONE)\s*=", text) else None


def _openfoam(_: bytes, text: str) -> Format | None:
    return Format("openfoam") if re.search(r"^FoamFile\s*\{", text, re.MULTILINE) else None


def _by_extension(_: bytes, __: str) -> Format | None:
    """Numbers alone tell nothing."""
    return None


def _in_hdf5(name: bytes, form: str) -> Callable[[bytes, str], Format | None]:
    """Return what recognises a file of HDF5 by the name of a group that only this format has."""

    def recognise(data: bytes, _: str) -> Format | None:
        begins = any(data.startswith(b"\x89HDF\r\n\x1a\n", at) for at in (0, 512, 1024, 2048))
        return Format(form) if begins and name in data else None

    return recognise


def _xdmf(_: bytes, text: str) -> Format | None:
    return Format("xdmf") if _is_xml(text) and "<Xdmf" in text else None


def _exodus(data: bytes, text: str) -> Format | None:
    if data[:4] in (b"CDF\1", b"CDF\2", b"CDF\5"):
        return Format("exodus")
    return _in_hdf5(b"floating_point_word_size", "exodus")(data, text)


def _cgns(data: bytes, text: str) -> Format | None:
    old = data[4:24] == b"ADF Database Version"  # what CGNS had before HDF5
    return Format("cgns") if old else _in_hdf5(b"CGNSLibraryVersion", "cgns")(data, text)


def _off(_: bytes, text: str) -> Format | None:
    return Format("off") if re.match(r"(?:#[^\n]*\n\s*)*(?:ST)?C?N?4?n?OFF(?![A-Za-z])", text) else None


def _mfem(_: bytes, text: str) -> Format | None:
    return Format("mfem") if re.match(r"MFEM (?:\w+ )?mesh v", text) else None


def _mdpa(_: bytes, text: str) -> Format | None:
    return Format("mdpa") if re.match(r"(?://[^\n]*\n\s*)*Begin[ \t]+[A-Z]\w+", text) else None


def _dolfin(_: bytes, text: str) -> Format | None:
    return Format("dolfin-xml") if _is_xml(text) and "<dolfin" in text else None


_CARD = re.compile(r"(?mi)^(?:BEGIN[ \t,]+BULK\b|CEND\s*$|(?:GRID|CTRIA3|CQUAD4|CTETRA|CHEXA)\*?[ \t,]+\d+[ \t,])")


def _nastran(_: bytes, text: str) -> Format | None:
    """Recognise the beginning of bulk data, or the first cards of a mesh."""
    return Format("nastran") if _CARD.search(text) else None


# A line of five counts, behind comments, and the first point; or the first step of several. With four, as some write,
# it may be one of TetGen.
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_UCD = re.compile(
    rf"(?:#[^\n]*\n\s*)*(?:(?:\d+[ \t]+){{4}}\d+\s*[\r\n]\s*\d+(?:[ \t]+{_NUMBER}){{3}}\s*[\r\n]"
    r"|\d+\s+(?:data|geom|data_geom)\s+step\d+)"
)


def _avsucd(_: bytes, text: str) -> Format | None:
    """Recognise what may be called .inp, as files of Abaqus are."""
    return Format("avsucd") if _UCD.match(text) else None


def _unv(_: bytes, text: str) -> Format | None:
    """Recognise the beginning of a data set."""
    return Format("unv") if re.match(r"-1[ \t]*[\r\n]\s*\d{2,4}[ \t]*[\r\n]", text) else None


def _tecplot(data: bytes, text: str) -> Format | None:
    first = re.match(r"(?i)(?:#[^\n]*\n\s*)*(?:TITLE|VARIABLES|FILETYPE)\s*=", text)
    named = first and re.search(r"(?im)^[ \t]*VARIABLES\s*=", text)
    return Format("tecplot") if named or data.startswith(b"#!TD") else None


def _comsol(_: bytes, text: str) -> Format | None:
    """Recognise the version of the file, and what its objects are."""
    head = re.match(r"(?:#[^\n]*\n\s*)*0[ \t]+1\s", text)
    made = text.startswith("# Created by COMSOL") or re.search(r"(?m)^\s*4 Mesh\b", text)
    return Format("comsol") if head and made else None


def _gambit(_: bytes, text: str) -> Format | None:
    return Format("gambit") if text.startswith("CONTROL INFO") else None


def _fluent(_: bytes, text: str) -> Format | None:
    """Recognise the first section by its number."""
    return Format("fluent") if re.match(r"\(\s*\d+\s+[\"'(\d]", text) else None


def _is_xml(text: str) -> bool:
    return text.startswith(("<?xml", "<VTKFile", "<Xdmf", "<!DOCTYPE", "<dolfin"))


# By the name of the reader. A .msh is gmsh's, whatever meshio's default is; a file that becomes one is of version 2.2,
# in which each element has its group: meshio's writer of 4.1 has one for each run of them.
_VTK_GROUPS = "cell data that are called like a material"
OWN = {
    "stl": Own(
        "stl", _stl, {".stl": "stl"}, "STL",
        "text and binary; normals of the facets that moved are computed again", "solids",
    ),
    "vtk": Own(
        "vtk.legacy", _vtk, {".vtk": "vtk"}, "VTK",
        "1.0 to 5.1, text and binary, unstructured grids and polygons", _VTK_GROUPS,
    ),
    "gmsh": Own(
        "gmsh", _gmsh, {".msh": "gmsh22"}, "gmsh",
        "1, 2 and 4.1, text and binary, in one file or several; parameters (u, v) of nodes stay as they are",
        "physical groups; in version 1 also entities",
    ),
    "pvtu": Own("vtk.pvtu", _pvtu, {".pvtu": "pvtu"}, "VTK", "with its pieces, which are `.vtu`", _VTK_GROUPS),
    "vtu": Own(
        "vtk.vtu", _vtu, {".vtu": "vtu"}, "VTK",
        "text, base64, appended; uncompressed, zlib, lz4, lzma", _VTK_GROUPS, "`lz4`, where numbers are compressed so",
    ),
    "ply": Own(
        "ply", _ply, {".ply": "ply"}, "PLY",
        "text and binary; normals of the facets that moved are computed again", "none",
    ),
    "medit": Own(
        "medit", _medit, {".mesh": "medit"}, "MEDIT",
        "text; required vertices and edges, and corners, are held", "references",
    ),
    "lsdyna": Own(
        "lsdyna", _lsdyna, dict.fromkeys((".k", ".key", ".dyn"), "lsdyna"), "LS-DYNA",
        "cards in columns of 8, 10 and 20 and between commas; degenerate solids are what they are; no file that it "
        "includes", "parts; these by their titles, and sets of nodes, elements and parts",
    ),
    "abaqus": Own(
        "abaqus", _abaqus, {".inp": "abaqus"}, "Abaqus",
        "parts, instances, sets, sections; files that it includes; no mesh that comes from `*NGEN` and the like",
        "sections or, in a file without any, the sets of its elements; sets of nodes and of elements", beside=True,
    ),
    "obj": Own(
        "obj", _obj, {".obj": "obj"}, "Wavefront",
        "all dialects; a file that was cut between two lines is a smaller mesh, nothing tells it", "materials",
    ),
    "openfoam": Own(
        "openfoam", _openfoam, {".foam": "openfoam"}, "OpenFOAM",
        "a folder `polyMesh`, or a case or a `.foam` that stands for it; text and binary; other polyhedra are held",
        "zones of cells; patches, zones of faces and of points", beside=True,
    ),
    "tetgen": Own(
        "tetgen", _by_extension, {".node": "tetgen", ".ele": "tetgen"}, "TetGen, Triangle",
        "both files, and faces and edges beside them that have a marker; all files of the mesh are written",
        "attributes of elements; markers of faces", beside=True,
    ),
    "xdmf": Own(
        "xdmf", _xdmf, {".xdmf": "xdmf", ".xmf": "xdmf"}, "XDMF",
        "numbers as text, in raw files or in HDF5 beside it; mesh tags of FEniCS, and steps in time of one mesh",
        "mesh tags of cells, and cell data that are called like a material; sets", "`h5py`, where numbers are in HDF5",
        beside=True,
    ),
    "med": Own(
        "med", _in_hdf5(b"ENS_MAA", "med"), {".med": "med", ".mmed": "med", ".rmed": "med"}, "MED",
        "versions 2 to 4, of one mesh at one step, also compressed; fields of one step are data", "families; groups",
        "`h5py`",
    ),
    "exodus": Own(
        "exodus", _exodus, dict.fromkeys((".e", ".exo", ".ex2", ".exii", ".g", ".gen"), "exodus"), "Exodus II",
        "netCDF of every form; one piece of a decomposition (`.e.4.0`) alone; polygons and polyhedra are held",
        "blocks; sets of nodes, sides and elements", "`h5py`, where it is netCDF-4",
    ),
    "cgns": Own(
        "cgns", _cgns, {".cgns": "cgns"}, "CGNS",
        "of HDF5, one base; sections, and blocks of points; zones are joined by their interfaces, else where their "
        "boundaries are at one place; no polygons or polyhedra",
        "families of zones and cells; boundary conditions, which are held, and sections", "`h5py`",
    ),
    "su2": Own("su2", _su2, {".su2": "su2"}, "SU2", "zones, markers, boxes of deformation", "zones; markers"),
    "off": Own(
        "off", _off, {".off": "off"}, "Geomview",
        "all keywords and dialects in text; colours, normals and texture coordinates stay", "none",
    ),
    "mfem": Own(
        "mfem", _mfem, {".mesh": "mfem"}, "MFEM",
        "versions 1.0, 1.2 and 1.3, also with nodes of first or second order; no NURBS or nonconforming meshes",
        "attributes; their sets, and those of the boundary",
    ),
    "mdpa": Own(
        "mdpa", _mdpa, {".mdpa": "mdpa"}, "Kratos",
        "elements, conditions and geometries, whose names tell what they are; data stay",
        "properties; parts of the model, also in parts",
    ),
    "avsucd": Own(
        "avsucd", _avsucd, {".avs": "avsucd", ".ucd": "avsucd", ".inp": "avsucd"}, "AVS UCD",
        "text, of one or several steps of one mesh; data stay; cells of second order are held", "materials",
    ),
    "nastran": Own(
        "nastran", _nastran, dict.fromkeys((".bdf", ".nas", ".fem", ".blk"), "nastran"), "Nastran, OptiStruct",
        "fields in columns of 8 and 16 and between commas, under other names too; points in one rectangular system; "
        "no `INCLUDE`; rigid elements, springs and masses hold their points",
        "properties; single-point constraints",
    ),
    "dolfin-xml": Own(
        "dolfin", _dolfin, {".xml": "dolfin-xml"}, "DOLFIN",
        "meshes of all types of cells; functions and values of the mesh, in it or beside it, stay", "values of cells",
    ),
    "unv": Own(
        "unv", _unv, {".unv": "unv"}, "I-deas",
        "universal files, with points and elements in their newer data sets; points in one rectangular system",
        "properties, materials, and what is in the same groups; groups of points and elements",
    ),
    "tecplot": Own(
        "tecplot", _tecplot, dict.fromkeys((".tec", ".plt", ".tecplot"), "tecplot"), "Tecplot",
        "text, by points and by variables; zones of elements and of points in order, each a part of its own; no "
        "polygons or polyhedra", "zones",
    ),
    "comsol": Own(
        "comsol", _comsol, {".mphtxt": "comsol"}, "Comsol",
        "text, with one mesh; prisms and pyramids of second order are held",
        "entities; those of the boundary, and selections",
    ),
    "gambit": Own(
        "gambit", _gambit, {".neu": "gambit"}, "Gambit",
        "neutral files; solids of 13, 15 and 20 nodes are held", "groups; boundary conditions, whose faces are held",
    ),
    "fluent": Own(
        "fluent", _fluent, {".cas": "fluent", ".msh": "fluent"}, "Ansys Fluent",
        "text and binary; other polyhedra and polygons are held", "zones of cells and of faces",
    ),
    "elmer": Own(
        "elmer", _by_extension, dict.fromkeys((".header", ".nodes", ".elements"), "elmer"), "Elmer",
        "a folder with `mesh.header`, or one of its files; not what is partitioned",
        "bodies; elements of the boundary; their names in `mesh.names`", beside=True,
    ),
}  # fmt: skip


def of_folder(path: Path) -> Format:
    """Return the format of a mesh that is a folder, or of what stands for one."""
    return Format("elmer" if (path / "mesh.header").is_file() else "openfoam")


def sniff(data: bytes) -> Format | None:
    """Recognise a format by the first bytes of a file; None: unknown."""
    text = data[:HEAD].decode("latin-1").lstrip("\ufeff\xef\xbb\xbf \t\r\n")
    found = (own.recognise(data, text) for own in OWN.values())
    return next((form for form in found if form is not None), None) or _of_meshio(text)


def _of_meshio(text: str) -> Format | None:
    """Recognise what only meshio reads."""
    return Format("flac3d") if text.startswith("* FLAC3D") else None


def by_name(path: Path) -> Format | None:
    """Recognise a format by the extension, that before .gz where there is one; None: unknown."""
    suffix = inner(path).suffix.lower()
    for own in OWN.values():
        if suffix in own.extensions:
            return Format(own.extensions[suffix])
    import meshio

    names = [name for name in meshio.extension_to_filetypes.get(suffix, []) if name not in ENDLESS]
    return Format(names[0]) if names else None


def may_be(form: Format, path: Path) -> bool:
    """Whether a file of a format may have such an extension, though others may have it as well."""
    return form.reader in OWN and inner(path).suffix.lower() in OWN[form.reader].extensions


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


def readers() -> tuple[str, ...]:
    """Names of the formats that can be read."""
    import meshio

    return tuple(sorted({*OWN, *(set(meshio._helpers.reader_map) - set(ENDLESS))}))
