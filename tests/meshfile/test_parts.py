"""Meshes in several files of gmsh, as it splits them: joined by the numbers of nodes; gmsh is the oracle."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import error_line, run
from files_gmsh import boxes, periodic_box, plates, read_independently
from programs import gmsh_session
from splicing import WORD, repaired

from meshfix_cli import read
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.gmsh.parts import Parts

MODELS = {"boxes": boxes, "plates": plates, "periodic": periodic_box}
VARIANTS = [
    ("boxes", 2.2, 0, 1), ("boxes", 2.2, 1, 0), ("boxes", 4.1, 0, 1), ("boxes", 4.1, 1, 1), ("plates", 4.1, 1, 0),
    ("periodic", 4.1, 0, 0), ("periodic", 2.2, 1, 0),
]  # fmt: skip
variants = pytest.mark.parametrize(("model", "version", "binary", "ghosts"), VARIANTS)


def by_gmsh(folder: Path, model: str, version: float, binary: int, ghosts: int = 0, count: int = 3) -> tuple[str, Path]:
    """Let gmsh write a mesh as one file, and then in parts; the pattern of these, and the one file."""
    options = {"MshFileVersion": version, "Binary": binary, "PartitionCreateGhostCells": ghosts}
    maker: Callable[[Any], None] = MODELS[model]
    with gmsh_session(**options, PartitionSplitMeshFiles=1) as gmsh:
        maker(gmsh)
        gmsh.write(str(folder / "whole.msh"))
        gmsh.model.mesh.partition(count)
        gmsh.write(str(folder / "in.msh"))
    return str(folder / "in_*.msh"), folder / "whole.msh"


def parts(pattern: Path | str) -> list[Path]:
    return Parts.of(str(pattern)).paths


def places(files: list[tuple[Any, dict[str, Any]]]) -> dict[int, Counter[bytes]]:
    """By the numbers of nodes, all places that files have for them, and how often."""
    found: dict[int, Counter[bytes]] = {}
    for points, others in files:
        for tag, point in zip(others["tags"].tolist(), points, strict=True):
            found.setdefault(tag, Counter())[point.tobytes()] += 1
    return found


@variants
def test_parts_are_solved_as_one_mesh(model: str, version: float, binary: int, ghosts: int, tmp_path: Path) -> None:
    pattern, whole = by_gmsh(tmp_path, model, version, binary, ghosts)
    target = str(tmp_path / "out_*.msh")
    document = repaired(pattern, target)[0]
    single = read(whole)
    assert document.mesh.topology.m == single.mesh.topology.m
    assert int(document.mesh.movable.sum()) == int(single.mesh.movable.sum())
    assert document.fixed == single.fixed
    files = [
        (read_independently(old), read_independently(new))
        for old, new in zip(parts(pattern), parts(target), strict=True)
    ]
    before, after = (places([pair[i] for pair in files]) for i in range(2))
    assert before.keys() == after.keys()
    assert {len(found) for found in after.values()} == {1}
    moved_copies = [tag for tag in before if before[tag] != after[tag] and sum(before[tag].values()) > 1]
    assert moved_copies
    for (_, others_before), (_, others_after) in files:
        np.testing.assert_equal(others_after, others_before)


@variants
def test_every_other_byte_of_the_parts_is_the_same(
    model: str, version: float, binary: int, ghosts: int, tmp_path: Path
) -> None:
    pattern, _ = by_gmsh(tmp_path, model, version, binary, ghosts)
    document = repaired(pattern, str(tmp_path / "out_*.msh"))[0]
    total, most = 0, 3 * int(document.mesh.movable.sum())
    for old, new in zip(parts(pattern), parts(tmp_path / "out_*.msh"), strict=True):
        before, after = old.read_bytes(), new.read_bytes()
        if binary:
            changed = int((np.frombuffer(before, np.uint8) != np.frombuffer(after, np.uint8)).sum())
        else:
            words = WORD.split(before), WORD.split(after)
            assert words[0][::2] == words[1][::2]
            changed = sum(a != b for a, b in zip(words[0][1::2], words[1][1::2], strict=True))
        assert changed <= most * (8 if binary else 1)
        total += changed
    assert total > 0


@pytest.mark.parametrize("version", [2.2, 4.1])
def test_parts_hold_the_regions_of_the_whole_mesh(version: float, tmp_path: Path) -> None:
    pattern, whole = by_gmsh(tmp_path, "boxes", version, 0)
    joined, single = read(pattern), read(whole)
    assert joined.source.regions == single.source.regions
    assert joined.source.arrays.groups.keys() == single.source.arrays.groups.keys()
    labels = [
        dict(zip(np.concatenate([run.ids for run in one.source.cells if run.ids is not None]).tolist(),
                 np.concatenate(one.source.arrays.cell["gmsh:physical"]).tolist(), strict=True))
        for one in (joined, single)
    ]  # fmt: skip
    if version == 4.1:
        assert set(labels[0].values()) == set(labels[1].values())
    assert joined.fixed[f"between regions of {joined.source.regions[0]}"] > 0
    assert set(joined.ids.tolist()) <= labels[0].keys()


def test_parts_in_place_and_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    pattern, _ = by_gmsh(tmp_path, "boxes", 4.1, 0, count=11)
    assert [path.stem for path in parts(pattern)] == [f"in_{i}" for i in range(1, 12)]
    before = {path: path.read_bytes() for path in parts(pattern)}
    run("untangle", "-q", "--backup", pattern, pattern)
    assert all(path.with_name(f"{path.name}.bak").read_bytes() == data for path, data in before.items())
    assert any(path.read_bytes() != data for path, data in before.items())
    assert read(pattern).mesh.check()[0] == 0
    again = run("untangle", pattern, pattern)
    assert b"nothing was moved" in again.stdout


def test_the_report_names_elements_as_gmsh_does(tmp_path: Path) -> None:
    pattern, whole = by_gmsh(tmp_path, "boxes", 4.1, 1)
    joined, single = (run("quality", "--all", one, code=3).stdout.decode() for one in (pattern, whole))
    lines = [sorted(re.findall(r"element \d+ at .*", text)) for text in (joined, single)]
    numbers = [{line.split(" at ")[1] for line in one} for one in lines]
    assert numbers[0] == numbers[1]
    known = set()
    for path in parts(pattern):
        for _, ids, _ in read_independently(path)[1]["elements"].values():
            known |= {number for one in ids for number in one.tolist()}
    assert {int(line.split()[1]) for line in lines[0]} <= known


def test_nodes_that_the_parts_have_in_several_places_are_named(tmp_path: Path) -> None:
    pattern, _ = by_gmsh(tmp_path, "boxes", 2.2, 0)
    first, second = ({line.split()[0] for line in nodes(path).splitlines()} for path in parts(pattern)[:2])
    node = min(first & second, key=int)
    path = parts(pattern)[1]
    path.write_text(re.sub(rf"(?m)^{node} \S+ (\S+ \S+)$", rf"{node} 0.125 \1", path.read_text(), count=1))
    complaint = error_line("untangle", pattern, tmp_path / "out_*.msh")
    assert f"disagree about the point with the number {node}: " in complaint
    assert "in in_1.msh, (0.125, " in complaint
    assert not list(tmp_path.glob("out_*"))


def nodes(path: Path) -> str:
    return path.read_text().split("$Nodes\n")[1].split("$EndNodes")[0].split("\n", 1)[1]


def test_patterns_that_name_nothing_or_too_much(tmp_path: Path) -> None:
    pattern, whole = by_gmsh(tmp_path, "plates", 4.1, 0)
    for name, said in (
        ("none_*.msh", "there is no file of such a name"),
        ("none/in_*.msh", "No such file or directory"),
        ("in_*_*.msh", r"one \* in the name of the file"),
    ):
        with pytest.raises(ReadError, match=said):
            read(tmp_path / name)
    assert "OUTPUT needs one * in its name" in error_line("untangle", pattern, tmp_path / "out.msh")
    assert "cannot go into a stream" in error_line("untangle", pattern)
    assert "a * in OUTPUT is for a mesh in parts" in error_line("untangle", whole, tmp_path / "out_*.msh")
    (tmp_path / "in_12.msh").write_bytes((tmp_path / "in_3.msh").read_bytes())
    assert "would replace a part of the input" in error_line("untangle", pattern, tmp_path / "in_1*.msh")
    (tmp_path / "in_x.msh").write_text("OFF\n")
    with pytest.raises(ReadError, match=r"in_x\.msh: is not a file of gmsh"):
        read(pattern)
    assert not list(tmp_path.glob("out*"))


def test_a_file_whose_name_has_a_star_is_a_file(tmp_path: Path) -> None:
    _, whole = by_gmsh(tmp_path, "plates", 4.1, 0)
    odd = whole.rename(tmp_path / "odd*.msh")
    run("untangle", "-q", odd, odd)
    assert read(odd).mesh.check()[0] == 0


def test_no_other_file_takes_the_place_of_a_part_of_the_output(tmp_path: Path) -> None:
    """Parts may have names with any extension, or none."""
    pattern, _ = by_gmsh(tmp_path, "boxes", 4.1, 0)
    before = set(tmp_path.iterdir())
    part = parts(pattern)[0].stem.replace("in_", "out_")
    for names, beside in (("out_*", part), ("out_*.csv", f"{part}.csv"), ("out_*", f"{part}.bak.csv")):
        error = run("untangle", "--backup", "--history", tmp_path / beside, pattern, tmp_path / names, code=2).stderr
        assert b"is the name of a mesh" in error or b"may be the name of the backup" in error
    assert set(tmp_path.iterdir()) == before


def test_parts_become_one_file_of_another_format(tmp_path: Path) -> None:
    pattern, whole = by_gmsh(tmp_path, "plates", 4.1, 1)
    run("untangle", "-q", pattern, tmp_path / "out.vtk")
    run("untangle", "-q", "--format", "gmsh22", pattern, tmp_path / "out.msh")
    for name in ("out.vtk", "out.msh"):
        assert read(tmp_path / name).mesh.topology.m == read(whole).mesh.topology.m


def test_partitions_are_no_materials_in_one_file_either(tmp_path: Path) -> None:
    """Where there are no groups, gmsh saves the triangles between partitions as well."""
    with gmsh_session(MshFileVersion=4.1, Binary=0) as gmsh:
        periodic_box(gmsh)
        gmsh.write(str(tmp_path / "whole.msh"))
        gmsh.model.mesh.partition(3)
        gmsh.write(str(tmp_path / "cut.msh"))
    cut, whole = read(tmp_path / "cut.msh"), read(tmp_path / "whole.msh")
    assert cut.mesh.movable.sum() == whole.mesh.movable.sum()
    assert "elements between partitions" in cut.source.untold


def test_a_part_that_is_missing_is_told(tmp_path: Path) -> None:
    pattern, _ = by_gmsh(tmp_path, "boxes", 4.1, 0)
    (tmp_path / "in_2.msh").unlink()
    assert "there are 2 files, and 3 partitions of the mesh" in read(pattern).notes
