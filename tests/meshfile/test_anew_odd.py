"""What few meshes have, and no conversion may trip over: odd names, groups of two kinds or of nothing, odd data."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from laden import box, written
from programs import gmsh_session

from meshfix_cli.errors import WriteError
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.meshfile.groups import groups_of
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.source import Arrays, Cells, Source
from meshfix_cli.meshfile.writing import _write_anew

FORMS = [
    *(Format(name, binary) for name in ("vtu", "vtk", "gmsh22", "gmsh") for binary in (False, True)),
    *(Format(name) for name in ("xdmf", "exodus", "abaqus", "nastran", "medit", "su2")),
]  # fmt: skip
WITH_SETS = [form for form in FORMS if form.name in ("vtu", "vtk", "gmsh", "exodus", "abaqus", "xdmf")]
NOTHING = np.empty(0, dtype=np.int64)
NAMES = ["", " ", "a b", "a\u2028b", "1", "set_1", "p", " p", "Wall", "wall", 'a "b"', "süd", "日" * 90, "x" * 300]


def sets(names: list[str]) -> Arrays:
    """Cells and points of one name; of every second name the second cell."""
    cells = {name: [np.array([i % 2]), NOTHING] for i, name in enumerate(names)}
    return Arrays(cell_sets=cells)


@pytest.mark.parametrize("form", WITH_SETS)
def test_no_two_names_become_one(form: Format, tmp_path: Path) -> None:
    back, _ = written(box(arrays=sets(NAMES)), form, tmp_path / "out")
    groups = [group for group in groups_of(back).values() if sum(len(rows) for _, rows in group.cells) == 1]
    assert len(groups) == len(NAMES)


def test_gmsh_opens_files_with_long_names(tmp_path: Path) -> None:
    for binary in (False, True):
        written(box(arrays=sets(NAMES)), Format("gmsh", binary), tmp_path / "out.msh")
        with gmsh_session() as gmsh:
            gmsh.open(str(tmp_path / "out.msh"))
            found = [gmsh.model.getPhysicalName(*group) for group in gmsh.model.getPhysicalGroups()]
        assert len({*found}) == len(found) == len(NAMES)


@pytest.mark.parametrize("form", FORMS)
def test_a_group_of_cells_and_points_is_whole_or_named(form: Format, tmp_path: Path) -> None:
    arrays = Arrays(cell_sets={"both": [np.array([0]), NOTHING]}, point_sets={"both": np.array([4])})
    back, dropped = written(box(arrays=arrays), form, tmp_path / "out")
    whole = "both" in groups_of(back) and len(groups_of(back)["both"].points) == 5
    assert whole != ("group both" in dropped)


@pytest.mark.parametrize("form", FORMS)
def test_empty_groups_are_there_or_named(form: Format, tmp_path: Path) -> None:
    arrays = Arrays(
        cell={"gmsh:physical": [np.array([1, 2]), np.array([0, 0])]},
        groups={"one": np.array([1, 3]), "none": np.array([9, 3]), "one of facets": np.array([1, 2])},
        cell_sets={"void": [NOTHING, NOTHING]}, point_sets={"no points": NOTHING},
    )  # fmt: skip
    back, dropped = written(replace(box(arrays=arrays), regions=("gmsh:physical",)), form, tmp_path / "out")
    found = groups_of(back)
    for name in ("one", "none", "one of facets", "void", "no points"):
        assert name in found or f"group {name}" in dropped
        assert name == "one" or name not in found or not len(found[name].points)


@pytest.mark.parametrize("form", FORMS)
def test_odd_data_arrive_or_are_named(form: Format, tmp_path: Path) -> None:
    odd: dict[str, Any] = {
        "nothing": np.ones((5, 0)), "words": np.array(["x"] * 5), "complex": np.ones(5) * 1j, "no": np.full(5, np.nan),
        "large": np.arange(5, dtype=np.uint64) + 2**63, "tensors": np.arange(45.0).reshape(5, 3, 3),
        "x" * 300: np.arange(5), 'a\n"<': np.arange(5) / 3,
    }  # fmt: skip
    cell = {name: [values[:2], values[2:4]] for name, values in odd.items()}
    labels = {"material": [np.array([2**63 + 1, 5], dtype=np.uint64), np.array([1, 1], dtype=np.uint64)]}
    _, dropped = written(
        replace(box(arrays=Arrays(point=odd, cell=cell | labels)), regions=("material",)), form, tmp_path / "out"
    )
    assert {f"{kind} data {name}" for kind in ("point", "cell") for name in ("words", "complex")} <= {*dropped}


@pytest.mark.parametrize("form", FORMS)
def test_of_a_type_without_cells_nothing_is_dropped(form: Format, tmp_path: Path) -> None:
    """As "Triangles 0" of medit, or an empty block of meshio."""
    source = box()
    none = np.empty((0, 6), dtype=np.int64)
    arrays = Arrays(cell={"quality": [np.array([1.0, 2.0]), np.array([3.0, 4.0]), np.empty(0)]})
    back, dropped = written(
        replace(source, cells=[*source.cells, Cells("triangle6", none)], load=lambda: arrays), form, tmp_path / "out"
    )
    assert {*dropped} == ({"cell data quality"} if "quality" not in back.arrays.cell else set())


@pytest.mark.parametrize("form", FORMS)
def test_cells_of_a_type_that_are_left_out_in_part_are_named(form: Format, tmp_path: Path) -> None:
    ragged: Any = [np.array([0, 1, 2, 3, 4]), np.array([0, 1, 2, 3, 4, 0])]
    source = box()
    source = replace(source, cells=[*source.cells, Cells("polygon", np.arange(5)[None]), Cells("polygon", ragged)])
    _, dropped = written(source, form, tmp_path / "out")
    assert dropped == ("polygon cells",)


@pytest.mark.parametrize("form", FORMS)
def test_formats_without_any_of_the_elements_say_so(form: Format, tmp_path: Path) -> None:
    """Pyramids of 14 nodes, and hexahedra of 24 for those that have such pyramids."""
    key = "hexahedron24" if form.name in ("gmsh22", "gmsh", "exodus") else "pyramid14"
    kind = ELEMENTS[key]
    points = np.random.default_rng(0).random((kind.nodes, 3))
    source = Source(points, [Cells(key, np.arange(kind.nodes)[None])])
    with pytest.raises(WriteError, match=f"{form.name}: that holds no "):
        _write_anew(tmp_path / "out", source, points, form)
