"""DOLFIN's files: attributes in any order, cells in a grid of coordinates, regions, and what is no mesh."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest
from elements import MESHES
from files_dolfin_xml import FILES, text
from files_medit import material
from shapes import block, plate

from meshfix_cli import read, untangle, write
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile import formats
from meshfix_cli.meshfile.dolfin import parse
from meshfix_cli.meshfile.recognise import Format

SMALL = (
    b'<dolfin>\n<mesh celltype="triangle" dim="2">\n<vertices size="5">\n<vertex index="0" x="0" y="0"/>\n'
    b'<vertex index="1" x="1" y="0"/>\n<vertex index="2" x="1" y="1"/>\n<vertex index="3" x="0" y="1"/>\n'
    b'<vertex index="4" x="1.5" y="0.5"/>\n</vertices>\n<cells size="4">\n'
    b'<triangle index="0" v0="0" v1="1" v2="4"/>\n<triangle index="1" v0="1" v1="2" v2="4"/>\n'
    b'<triangle index="2" v0="2" v1="3" v2="4"/>\n<triangle index="3" v0="0" v1="3" v2="4"/>\n'
    b"</cells>\n</mesh>\n</dolfin>\n"
)


def test_meshio_finds_the_same(tmp_path: Path) -> None:
    for name, d in (("plane.xml", 2), ("domains.xml", 3)):
        FILES[name](tmp_path / name)
        source, other = parse((tmp_path / name).read_bytes()), meshio.read(tmp_path / name)
        np.testing.assert_array_equal(source.points, other.points)
        np.testing.assert_array_equal(source.cells[0].vertices, other.cells[0].data)
        assert source.points.shape[1] == d
        assert not source.oriented


def test_the_order_of_vertices_and_attributes_does_not_matter(tmp_path: Path) -> None:
    FILES["unordered.xml"](tmp_path / "in.xml")
    source = parse((tmp_path / "in.xml").read_bytes())
    points, cells = plate()
    np.testing.assert_array_equal(source.points[source.cells[0].vertices], points[cells][..., :2])
    assert source.cells[0].ids is not None
    assert source.cells[0].ids.tolist() == list(range(len(cells)))


def test_values_of_cells_are_regions(tmp_path: Path) -> None:
    FILES["domains.xml"](tmp_path / "in.xml")
    document = read(tmp_path / "in.xml")
    assert document.source.regions == ("dolfin:domains",)
    np.testing.assert_array_equal(document.source.arrays.cell["dolfin:domains"][0], material(*block()))


def test_functions_of_cells_are_regions() -> None:
    function = (
        b'<data><data_entry name="material_indicators"><mesh_function type="uint" dim="2" size="4">\n'
        + b"".join(b'<entity index="%d" value="%d"/>' % (i, i // 2) for i in range(4))
        + b'</mesh_function></data_entry><mesh_function type="double" dim="2" size="0"/></data>\n'
    )
    source = parse(SMALL.replace(b"</mesh>", function + b"</mesh>"))
    assert source.regions == ("dolfin:domains",)
    assert source.arrays.cell["dolfin:domains"][0].tolist() == [0, 0, 1, 1]
    assert source.untold == ("functions and values of the mesh",)


def test_quadrilaterals_and_hexahedra_run_by_coordinates(tmp_path: Path) -> None:
    grids = {
        "quadrilateral": [[i >> 1, i & 1] for i in range(4)],
        "hexahedron": [[i >> 2, i >> 1 & 1, i & 1] for i in range(8)],
    }
    for kind, corners in grids.items():
        d, cells = len(corners[0]), np.arange(len(corners))[None]
        words = text(np.array(corners, dtype=float), cells, "xyz"[:d], kind)
        (tmp_path / "in.xml").write_text(words.replace(f'dim="{len(corners) - 1}"', f'dim="{d}"'))
        document = read(tmp_path / "in.xml")
        assert document.mesh.topology.m == 1
        assert document.mesh.check()[0] == 0


def test_a_mesh_of_hexahedra_is_repaired(tmp_path: Path) -> None:
    points, blocks = MESHES["graded quads"]()
    (rows,) = [rows for key, rows in blocks if key == "quad"]
    words = text(points, rows[:, [0, 1, 3, 2]].astype(np.int64), "xy", "quadrilateral").replace('dim="3"', 'dim="2"')
    (tmp_path / "in.xml").write_text(words)
    document = read(tmp_path / "in.xml")
    assert document.mesh.topology.m == len(rows)
    assert document.mesh.check()[0] == 0
    outcome = untangle(document.mesh)
    assert write(document, outcome.after, tmp_path / "out.xml")[1] == ()


def test_files_beside_it_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "in.xml").write_bytes(SMALL)
    function = (
        '<dolfin><mesh_function type="uint" dim="1" size="1"><entity index="0" value="1"/></mesh_function></dolfin>'
    )
    (tmp_path / "in_facet_region.xml").write_text(function)
    assert read(tmp_path / "in.xml").mesh.check()[0] == 1
    with pytest.raises(ReadError, match="holds a mesh function of dolfin, and no mesh"):
        read(tmp_path / "in_facet_region.xml")


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (
            b"<?xml version='1.0'?>\n<dolfin><parameters name='a'/></dolfin>",
            "holds a parameters of dolfin, and no mesh",
        ),
        (b"<dolfin>\n  <function>\n</function></dolfin>", "holds a function of dolfin, and no mesh"),
        (b"<dolfin></dolfin>", "holds nothing, and no mesh"),
        (SMALL + SMALL, "holds several meshes"),
        (SMALL.replace(b'"triangle"', b'"prism"'), "its cells are 'prism' in '2' dimensions"),
        (SMALL.replace(b'dim="2"', b'dim="two"'), "its cells are 'triangle' in 'two' dimensions"),
        (SMALL.replace(b'size="5"', b'size="6"'), "it announces 6 vertices and holds 5"),
        (SMALL.replace(b'size="4"', b'size="3"'), "it announces 3 cells and holds 4"),
        (SMALL.replace(b"</cells>", b""), "is truncated: its cells do not end"),
        (SMALL.replace(b"<vertices", b"<vortices"), "is truncated: its vertices do not begin"),
        (
            SMALL.replace(b' x="1.5"', b""),
            "line 3: the vertices have not all the attributes index, x, y, and no others",
        ),
        (SMALL.replace(b" x=", b" u="), "line 4: there is no attribute x"),
        (SMALL.replace(b"1.5", b"one"), "line 8: 'one.* is not a number"),
        (SMALL.replace(b'v2="4"', b'v2="5"'), "the cell 0 names the point 5"),
        (SMALL.replace(b'index="1" x', b'index="0" x'), "the point 0 is defined twice"),
    ],
)
def test_what_is_wrong_is_named(data: bytes, words: str) -> None:
    with pytest.raises(ReadError, match=words):
        parse(data)
    assert formats.sniff(data) == Format("dolfin-xml")


@pytest.mark.parametrize("name", FILES)
def test_truncated(name: str, tmp_path: Path) -> None:
    FILES[name](tmp_path / name)
    data = (tmp_path / name).read_bytes()
    end = data.index(b"</cells>")
    for cut in range(0, end, max(1, end // 60)):
        with pytest.raises(ReadError):
            parse(data[:cut])
