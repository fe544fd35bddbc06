"""Which format a file has: from its first bytes, then from its name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from meshfix_cli.meshfile import recognise
from meshfix_cli.meshfile.compressed import inner
from meshfix_cli.meshfile.recognise import Format

HEAD = 4096  # bytes that are enough to recognise a format

ENDLESS = ("tecplot", "wkt")  # meshio reads truncated files of these for ever
BOTH = ("gmsh", "gmsh22", "ply", "stl", "vtk", "vtk42", "vtu")  # written as text or binary


DRAWINGS = ("byu", "obj", "off", "ply", "stl")  # these have no plane meshes, and their faces need not be elements
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


# By the name of the reader. A .msh is gmsh's, whatever meshio's default is; a file that becomes one is of version 2.2,
# which most programs read.
_VTK_GROUPS = "cell data that are called like a material; bytes of 0 and 1, as sets"
_LZ4 = "`lz4`, where numbers are compressed so"
OWN = {
    "stl": Own(
        "stl", recognise.stl, {".stl": "stl"}, "STL",
        "text and binary; normals of the facets that moved are computed again", "solids",
    ),
    "vtk": Own(
        "vtk.legacy", recognise.vtk, {".vtk": "vtk"}, "VTK",
        "1.0 to 5.1, text and binary, unstructured and structured grids, and polygons", _VTK_GROUPS,
    ),
    "gmsh": Own(
        "gmsh", recognise.gmsh, {".msh": "gmsh22"}, "gmsh",
        "1, 2 and 4.1, text and binary, in one file or several; parameters (u, v) of nodes stay as they are",
        "physical groups; in version 1 also entities",
    ),
    "pvtu": Own(
        "vtk.pvtu", recognise.names_pieces("PUnstructuredGrid", "pvtu"), {".pvtu": "pvtu"}, "VTK",
        "with its pieces, which are `.vtu`", _VTK_GROUPS,
    ),
    "pvtp": Own(
        "vtk.pvtu", recognise.names_pieces("PPolyData", "pvtp"), {".pvtp": "pvtp"}, "VTK",
        "with its pieces, which are `.vtp`", _VTK_GROUPS,
    ),
    "vtm": Own(
        "vtk.vtm",
        recognise.names_pieces("vtkMultiBlockDataSet|vtkPartitionedDataSet(?:Collection)?|Collection", "vtm"),
        dict.fromkeys((".vtm", ".vtmb", ".vtpc", ".vtpd", ".pvd"), "vtm"), "VTK",
        "with its blocks, which are `.vtu`, `.vtp` and `.vts`; one step in time", f"blocks; {_VTK_GROUPS}",
    ),
    "vtu": Own(
        "vtk.vtu", recognise.of_vtk("UnstructuredGrid", "vtu"), {".vtu": "vtu"}, "VTK",
        "text, base64, appended; uncompressed, zlib, lz4, lzma", _VTK_GROUPS, _LZ4,
    ),
    "vtp": Own(
        "vtk.vtp", recognise.of_vtk("PolyData", "vtp"), {".vtp": "vtp"}, "VTK",
        "as `.vtu`; strips of triangles are held", _VTK_GROUPS, _LZ4,
    ),
    "vts": Own(
        "vtk.vts", recognise.vts, {".vts": "vts"}, "VTK",
        "as `.vtu`, of one piece; no grids without coordinates for each point (`.vti`, `.vtr`)", _VTK_GROUPS, _LZ4,
    ),
    "vtkhdf": Own(
        "vtk.vtkhdf", recognise.in_hdf5(b"VTKHDF", "vtkhdf"), {".vtkhdf": "vtkhdf"}, "VTK",
        "in HDF5, unstructured grids and polydata in parts, and blocks of them; steps in time of one mesh",
        _VTK_GROUPS + "; blocks", "`h5py`",
    ),
    "ply": Own(
        "ply", recognise.ply, {".ply": "ply"}, "PLY",
        "text and binary; normals of the facets that moved are computed again", "none",
    ),
    "medit": Own(
        "medit.text", recognise.medit, {".mesh": "medit"}, "MEDIT",
        "text; required vertices and edges, and corners, are held, and so are solids of second order whose order of "
        "nodes the file does not give", "references",
    ),
    "meshb": Own(
        "medit.binary", recognise.meshb, {".meshb": "meshb"}, "MEDIT",
        "binary, versions 1 to 4, of either order of bytes; what is held, as in `.mesh`", "references",
    ),
    "lsdyna": Own(
        "lsdyna", recognise.lsdyna, dict.fromkeys((".k", ".key", ".dyn"), "lsdyna"), "LS-DYNA",
        "cards in columns of 8, 10 and 20 and between commas; degenerate solids are what they are; no file that it "
        "includes", "parts; these by their titles, and sets of nodes, elements and parts",
    ),
    "mapdl": Own(
        "mapdl", recognise.mapdl, {".cdb": "mapdl"}, "Ansys Mechanical",
        "archives and input files with blocks of nodes and elements, under other names too; elements that have a "
        "command each stay", "materials and types; components",
    ),
    "abaqus": Own(
        "abaqus", recognise.abaqus, {".inp": "abaqus"}, "Abaqus",
        "parts, instances, sets, sections; files that it includes; no mesh that comes from `*NGEN` and the like",
        "sections or, in a file without any, the sets of its elements; sets of nodes and of elements", beside=True,
    ),
    "obj": Own(
        "obj", recognise.obj, {".obj": "obj"}, "Wavefront",
        "all dialects; a file that was cut between two lines is a smaller mesh, nothing tells it", "materials",
    ),
    "openfoam": Own(
        "openfoam", recognise.openfoam, {".foam": "openfoam"}, "OpenFOAM",
        "a folder `polyMesh`, or a case or a `.foam` that stands for it; text and binary; other polyhedra are held",
        "zones of cells; patches, zones of faces and of points", beside=True,
    ),
    "tetgen": Own(
        "tetgen", recognise.by_extension, {".node": "tetgen", ".ele": "tetgen"}, "TetGen, Triangle",
        "both files, and faces and edges beside them that have a marker; all files of the mesh are written",
        "attributes of elements; markers of faces", beside=True,
    ),
    "xdmf": Own(
        "xdmf", recognise.xdmf, {".xdmf": "xdmf", ".xmf": "xdmf"}, "XDMF",
        "numbers as text, in raw files or in HDF5 beside it; mesh tags of FEniCS, and steps in time of one mesh",
        "mesh tags of cells, and cell data that are called like a material; sets, also as bytes of 0 and 1",
        "`h5py`, where numbers are in HDF5",
        beside=True,
    ),
    "med": Own(
        "med", recognise.in_hdf5(b"ENS_MAA", "med"), {".med": "med", ".mmed": "med", ".rmed": "med"}, "MED",
        "versions 2 to 4, of one mesh at one step, also compressed; fields of one step are data", "families; groups",
        "`h5py`",
    ),
    "exodus": Own(
        "exodus", recognise.exodus, dict.fromkeys((".e", ".exo", ".ex2", ".exii", ".g", ".gen"), "exodus"), "Exodus II",
        "netCDF of every form; one piece of a decomposition (`.e.4.0`) alone; polygons and polyhedra are held",
        "blocks; sets of nodes, sides and elements", "`h5py`, where it is netCDF-4",
    ),
    "exotxt": Own(
        "exodus.exotxt", recognise.exotxt, dict.fromkeys((".exotxt", ".g"), "exotxt"), "Exodus II as text",
        "what `exotxt` of SEACAS makes of a file; steps in time stay", "blocks; sets of nodes and sides",
    ),
    "cgns": Own(
        "cgns", recognise.cgns, {".cgns": "cgns"}, "CGNS",
        "of HDF5, one base; sections, and blocks of points; zones are joined by their interfaces, else where their "
        "boundaries are at one place; no polygons or polyhedra",
        "families of zones and cells; boundary conditions, which are held, and sections", "`h5py`",
    ),
    "su2": Own(
        "su2", recognise.su2, {".su2": "su2"}, "SU2",
        "zones, markers, boxes of deformation, elements of order up to ten", "zones; markers",
    ),
    "off": Own(
        "off", recognise.off, {".off": "off"}, "Geomview",
        "all keywords and dialects in text; colours, normals and texture coordinates stay", "none",
    ),
    "mfem": Own(
        "mfem", recognise.mfem, {".mesh": "mfem"}, "MFEM",
        "versions 1.0, 1.2 and 1.3, also with nodes of any order up to ten, shared or of each element; no NURBS or "
        "nonconforming meshes",
        "attributes; their sets, and those of the boundary",
    ),
    "mdpa": Own(
        "mdpa", recognise.mdpa, {".mdpa": "mdpa"}, "Kratos",
        "elements, conditions and geometries, whose names tell what they are; data stay",
        "properties; parts of the model, also in parts",
    ),
    "avsucd": Own(
        "avsucd", recognise.avsucd, {".avs": "avsucd", ".ucd": "avsucd", ".inp": "avsucd"}, "AVS UCD",
        "text, of one or several steps of one mesh; data stay; cells of second order are held", "materials",
    ),
    "nastran": Own(
        "nastran", recognise.nastran, dict.fromkeys((".bdf", ".nas", ".fem", ".blk"), "nastran"), "Nastran, OptiStruct",
        "fields in columns of 8 and 16 and between commas, under other names too; points in one rectangular system; "
        "no `INCLUDE`; rigid elements, springs and masses hold their points",
        "properties; single-point constraints",
    ),
    "dolfin-xml": Own(
        "dolfin", recognise.dolfin, {".xml": "dolfin-xml"}, "DOLFIN",
        "meshes of all types of cells; functions and values of the mesh, in it or beside it, stay", "values of cells",
    ),
    "unv": Own(
        "unv", recognise.unv, {".unv": "unv"}, "I-deas",
        "universal files, with points and elements in their newer data sets; points in one rectangular system",
        "properties, materials, and what is in the same groups; groups of points and elements",
    ),
    "tecplot": Own(
        "tecplot", recognise.tecplot, dict.fromkeys((".tec", ".plt", ".tecplot"), "tecplot"), "Tecplot",
        "text, by points and by variables; zones of elements and of points in order, each a part of its own; no "
        "polygons or polyhedra", "zones",
    ),
    "comsol": Own(
        "comsol", recognise.comsol, {".mphtxt": "comsol"}, "Comsol",
        "text, with one mesh; prisms and pyramids of second order are held",
        "entities; those of the boundary, and selections",
    ),
    "gambit": Own(
        "gambit", recognise.gambit, {".neu": "gambit"}, "Gambit",
        "neutral files; solids of 13, 15 and 20 nodes are held", "groups; boundary conditions, whose faces are held",
    ),
    "byu": Own(
        "byu", recognise.byu, {".byu": "byu", ".g": "byu"}, "MOVIE.BYU",
        "in columns and without; polygons of five points or more are held", "parts",
    ),
    "netgen": Own(
        "netgen", recognise.netgen, {".vol": "netgen"}, "Netgen",
        "all dialects of surface elements and edges; the geometry behind the mesh stays; no curved elements",
        "domains and boundaries; these by their names",
    ),
    "fluent": Own(
        "fluent", recognise.fluent, {".cas": "fluent", ".msh": "fluent"}, "Ansys Fluent",
        "text and binary; other polyhedra and polygons are held", "zones of cells and of faces",
    ),
    "freefem": Own(
        "freefem", recognise.freefem, {".msh": "freefem"}, "FreeFEM",
        "triangles in the plane and in space, and tetrahedra", "labels; those of the boundary",
    ),
    "ugrid": Own(
        "ugrid", recognise.ugrid, {".ugrid": "ugrid"}, "UGRID (AFLR)",
        "text, and binary of either byte order and precision, as a stream and as records of Fortran",
        "parts of the surface",
    ),
    "adcirc": Own(
        "adcirc", recognise.adcirc, dict.fromkeys((".14", ".grd", ".gr3"), "adcirc"), "ADCIRC, SCHISM",
        "grids of triangles and quadrilaterals; depths stay with their nodes; nodes that a barrier pairs are held",
        "open and land boundaries",
    ),
    "febio": Own(
        "febio", recognise.febio, {".feb": "febio"}, "FEBio",
        "versions 1 to 4, with the mesh in the file; no instances of parts",
        "materials; parts, surfaces, and sets of nodes and elements",
    ),
    "getfem": Own(
        "getfem", recognise.getfem, {".mesh": "getfem"}, "GetFEM",
        "convexes of any order on a lattice; others are held", "regions, of faces where these are of simplices",
    ),
    "elmer": Own(
        "elmer", recognise.by_extension, dict.fromkeys((".header", ".nodes", ".elements"), "elmer"), "Elmer",
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
    return tuple(sorted(both - {"tetgen", *ENDLESS} | {"gmsh22", "vtk42", "meshb"}))


def options(form: Format) -> dict[str, object]:
    """Keyword arguments for meshio's writer."""
    return {} if form.binary is None else {"binary": form.binary}


def readers() -> tuple[str, ...]:
    """Names of the formats that can be read."""
    import meshio

    return tuple(sorted({*OWN, *(set(meshio._helpers.reader_map) - set(ENDLESS))}))
