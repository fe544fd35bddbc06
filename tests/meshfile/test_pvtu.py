"""Meshes in several files of VTK: joined, solved as one, and each piece written back; VTK is the oracle."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from commands import POSIX, SLOW_DISK, WRITES_FOR_EVER, error_line, run, start
from files_pvtu import by_vtk, grid, index, read_independently, save, slabs, split
from files_vtu import read_independently as read_piece
from numpy.typing import NDArray
from shapes import block, plate
from splicing import WORD, without_points
from splicing import repaired as repaired_with_points

from meshfix_cli import read
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.document import Document

VARIANTS: dict[str, dict[str, Any]] = {
    "text": {"mode": "Ascii"},
    "text with ids": {"mode": "Ascii", "ids": True},
    "base64 with ghosts": {"mode": "Binary", "ghosts": True},
    "appended with ids and ghosts": {"ids": True, "ghosts": True},
    "raw": {"mode": "Raw"},
    "compressed": {"mode": "Raw", "compressor": "ZLib", "ids": True},
}
SHAPES = {"block": block, "plate": plate}


def made(folder: Path, shape: str = "block", dtype: str = "f8", count: int = 3, **options: Any) -> Path:
    points, cells = SHAPES[shape]()
    return split(folder / "in.pvtu", points.astype(dtype), cells, slabs(points, cells, count), **options)


def pieces(path: Path) -> list[Path]:
    return [path.parent / name for name in re.findall("Source=['\"]([^'\"]*)['\"]", path.read_text())]


def repaired(path: Path | str, target: Path | str, **options: Any) -> Document:
    return repaired_with_points(path, target, **options)[0]


def in_order_of_pieces(shape: str, count: int, ghosts: bool) -> tuple[NDArray[Any], NDArray[Any]]:
    """The points and cells of the mesh as one file that has them in the order in which they appear in the pieces."""
    points, cells = SHAPES[shape]()
    piece = slabs(points, cells, count)
    seen: list[int] = []
    for i in range(count):
        near = np.isin(cells, cells[piece == i]).any(axis=1) if ghosts else piece == i
        seen += np.unique(cells[near]).tolist()
    order = np.array(list(dict.fromkeys(seen)))
    number = np.full(len(points), -1)
    number[order] = np.arange(len(order))
    return points[order], number[cells[np.argsort(piece, kind="stable")]]


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("variant", VARIANTS)
def test_pieces_are_solved_as_one_mesh_and_nothing_but_coordinates_changes(
    variant: str, shape: str, tmp_path: Path
) -> None:
    options = VARIANTS[variant]
    dtype = "f4" if shape == "plate" else "f8"
    path, target = made(tmp_path, shape, dtype, **options), tmp_path / "out.pvtu"
    document = repaired(path, target)

    points, cells = in_order_of_pieces(shape, 3, options.get("ghosts", False))
    np.testing.assert_array_equal(document.source.points, points.astype(dtype))
    np.testing.assert_array_equal(np.concatenate([part.vertices for part in document.parts]), cells)
    save(tmp_path / "single.vtu", grid(points.astype(dtype), cells, {}, {}))
    repaired(tmp_path / "single.vtu", tmp_path / "out_single.vtu")
    expected, _ = read_piece(tmp_path / "out_single.vtu")

    before, others_before = read_independently(path)
    after, others_after = read_independently(target)
    np.testing.assert_equal(others_after, others_before)
    assert {"point height", "cell origin"} <= others_after.keys()
    place = {tuple(p): i for i, p in enumerate(points.astype(dtype).tolist())}
    rows = np.array([place[tuple(p)] for p in before.tolist()])
    assert after.tobytes() == expected[rows].tobytes()
    assert (after != before).any(axis=1)[np.bincount(rows)[rows] > 1].any()  # on interfaces


@pytest.mark.parametrize("variant", VARIANTS)
def test_every_other_byte_of_all_files_is_the_same(variant: str, tmp_path: Path) -> None:
    path, target = made(tmp_path, **VARIANTS[variant]), tmp_path / "out.pvtu"
    repaired(path, target)
    assert [one.name for one in pieces(target)] == ["out_0.vtu", "out_1.vtu", "out_2.vtu"]
    assert target.read_text() == path.read_text().replace("'in_", "'out_")
    for old, new in zip(pieces(path), pieces(target), strict=True):
        if VARIANTS[variant].get("mode") == "Ascii":
            before, after = (WORD.split(one.read_bytes()) for one in (old, new))
            assert before[::2] == after[::2]
            changed = sum(a != b for a, b in zip(before[1::2], after[1::2], strict=True))
            assert 0 < changed <= (read_piece(old)[0] != read_piece(new)[0]).sum()
        else:
            assert without_points(old.read_bytes()) == without_points(new.read_bytes())
            assert old.read_bytes() != new.read_bytes()


def test_what_vtk_itself_cuts_is_joined_again(tmp_path: Path) -> None:
    path, target = by_vtk(tmp_path / "in.pvtu"), tmp_path / "out.pvtu"
    document = repaired(path, target)
    points, cells = block()
    assert document.mesh.topology.m == len(cells)
    assert int(document.mesh.topology.used.sum()) == len(points)
    assert document.fixed == {"on the boundary": int((~document.mesh.movable).sum())}
    assert document.notes == (f"joined 4 files at {_shared(path)} common points, by global ids",)
    before, others_before = read_independently(path)
    after, others_after = read_independently(target)
    np.testing.assert_equal(others_after, others_before)
    ids = others_after["point GlobalPointIds"]
    for number in np.unique(ids):
        assert len({point.tobytes() for point in after[ids == number]}) == 1
    assert (before != after).any()


def _shared(path: Path) -> int:
    ids = read_independently(path)[1]["point GlobalPointIds"]
    return int((np.unique(ids, return_counts=True)[1] > 1).sum())


def test_names_without_a_declaration_are_those_of_global_ids(tmp_path: Path) -> None:
    path = made(tmp_path, mode="Ascii", ids=True)
    for piece in pieces(path):
        text = piece.read_text().replace(' GlobalIds="ids"', "").replace('"ids"', '"GlobalNodeId"')
        piece.write_text(text)
    assert "by global ids" in read(path).notes[0]
    for piece in pieces(path):
        piece.write_text(piece.read_text().replace('"GlobalNodeId"', '"numbers"'))
    assert "by equal coordinates" in read(path).notes[0]


def test_ghosts_that_repeat_nothing_are_held(tmp_path: Path) -> None:
    """Without the piece that owns them, they are what is known of the mesh there."""
    path = made(tmp_path, ghosts=True)
    whole = read(path)
    index(path, ["in_0.vtu", "in_1.vtu"])
    part = read(path)
    assert part.fixed["by the file"] > 0
    assert 2 * whole.mesh.topology.m // 3 < part.mesh.topology.m < whole.mesh.topology.m
    assert part.mesh.movable.any()


def test_empty_pieces_are_pieces(tmp_path: Path) -> None:
    points, cells = block()
    piece = 2 * slabs(points, cells, 2) + 1
    path = split(tmp_path / "in.pvtu", points, cells, piece, ids=True)
    target = tmp_path / "out.pvtu"
    repaired(path, target)
    assert len(pieces(target)) == 4
    for i in (0, 2):
        assert (tmp_path / f"out_{i}.vtu").read_bytes() == (tmp_path / f"in_{i}.vtu").read_bytes()
    read_independently(target)
    index(path, ["in_0.vtu"])
    with pytest.raises(ReadError, match="there are no elements in it that are judged"):
        read(path)


def test_elements_are_named_by_their_position_among_those_of_all_pieces(tmp_path: Path) -> None:
    path = made(tmp_path, ghosts=True, ids=True)
    found = json.loads(run("quality", "--all", "--json", path, code=3).stdout)
    points, others = read_independently(path)
    corners = points[others["connectivity"].reshape(-1, 4)]
    volumes = np.linalg.det(corners[:, 1:] - corners[:, :1])
    inverted = np.flatnonzero((volumes < 0) & (others["cell vtkGhostType"] == 0))
    assert [one["id"] for one in found["first_inverted"]] == inverted.tolist()


# A square of 6 x 4 with a slit from (1, 2) to (3, 2): the point (2, 2) is there twice.
def slit() -> tuple[NDArray[Any], NDArray[Any]]:
    points = [(float(x), float(y), 0.0) for y in range(5) for x in range(7)] + [(2.0, 2.0, 0.0)]
    cells = []
    for y in range(4):
        for x in range(6):
            a = 7 * y + x
            corners = [a, a + 1, a + 8, a + 7]
            if y >= 2:
                corners = [35 if corner == 16 else corner for corner in corners]
            cells += [corners[:3], [corners[0], *corners[2:]]]
    return np.array(points), np.array(cells)


def quadrants(cells: NDArray[Any], points: NDArray[Any], x: float) -> tuple[NDArray[Any], NDArray[Any]]:
    middle = points[cells].mean(axis=1)
    return middle[:, 0] > x, middle[:, 1] > 2


def test_a_slit_inside_of_a_piece_stays_open(tmp_path: Path) -> None:
    points, cells = slit()
    right, _ = quadrants(cells, points, 4)
    document = read(split(tmp_path / "in.pvtu", points, cells, right.astype(int)))
    assert document.mesh.topology.n == len(points)
    assert [note[:16] for note in document.notes] == ["joined 2 files a", "2 points lie at "]
    assert not document.mesh.movable[(document.source.points == [2, 2, 0]).all(axis=1)].any()


@pytest.mark.parametrize("right_in_two", [False, True])
def test_a_slit_that_reaches_an_interface_needs_global_ids(right_in_two: bool, tmp_path: Path) -> None:
    points, cells = slit()
    right, upper = quadrants(cells, points, 2)
    piece = right.astype(int) + (right & upper & right_in_two)
    with pytest.raises(ReadError, match=r"in_0.vtu has 2 points at \(2, 2, 0\), where in_1.vtu has .* global ids"):
        read(split(tmp_path / "in.pvtu", points, cells, piece))
    document = read(split(tmp_path / "in.pvtu", points, cells, piece, ids=True))
    assert document.mesh.topology.n == len(points)
    assert not document.mesh.movable[(document.source.points == [2, 2, 0]).all(axis=1)].any()


def test_points_inside_of_pieces_are_never_joined(tmp_path: Path) -> None:
    """Inner points that have fallen together are as tangled as a mesh can be, but they are not one point."""
    points, cells = plate()
    piece = slabs(points, cells, 2)
    document = read(split(tmp_path / "in.pvtu", points, cells, piece))
    inner = document.mesh.movable[: len(np.unique(cells[piece == 0]))].nonzero()[0]
    shared = set(np.unique(cells[piece == 0])) & set(np.unique(cells[piece == 1]))
    used = np.unique(cells[piece == 0])
    inner = np.array([used[i] for i in inner if used[i] not in shared])[:4]
    points = points.copy()
    points[inner] = points[inner[0]]
    assert read(split(tmp_path / "in.pvtu", points, cells, piece)).mesh.topology.n == len(points)


def broken(folder: Path, what: str) -> Path:
    path = made(folder, mode="Ascii", ids=what in ("twice", "some ids", "apart", "ids that are no integers"))
    piece = folder / "in_1.vtu"
    text = piece.read_text()
    if what == "missing":
        piece.unlink()
    elif what == "nothing in it":
        piece.write_text("")
    elif what == "truncated":
        piece.write_text(text[: len(text) // 2])
    elif what == "of another type":
        piece.write_text(text.replace('type="UnstructuredGrid"', 'type="PolyData"'))
    elif what == "listed twice":
        index(path, ["in_0.vtu", "in_1.vtu", "./in_0.vtu"])
    elif what == "no pieces":
        index(path, [])
    elif what == "of another precision":
        points, cells = block()
        save(piece, grid(points.astype("f4"), cells, {}, {}))
    elif what == "some ids":
        piece.write_text(text.replace(' GlobalIds="ids"', "").replace('"ids"', '"numbers"'))
    elif what == "ids that are no integers":
        piece.write_text(re.sub(r'type="\w+"( IdType="1")? Name="ids"', 'type="Float64" Name="ids"', text))
    elif what == "twice":
        piece.write_text(re.sub(r'(Name="ids"[^>]*>\s*)(\d+) \d+', r"\1\2 \2", text))
    elif what == "apart":
        piece.write_text(re.sub(r'(Name="Points"[^>]*>\s*)\S+', r"\g<1>77", text))
    elif what == "outside":
        piece.write_text(re.sub(r'(Name="connectivity"[^>]*>\s*)\d+', r"\g<1>5000", text))
    elif what == "no materials":
        one = folder / "in_0.vtu"
        one.write_text(one.read_text().replace('"origin"', '"MaterialIDs"'))
    return path


@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("missing", "in.pvtu: in_1.vtu: No such file or directory"),
        ("ids that are no integers", "in_1.vtu: is not a readable VTK file: its array 'ids' does not hold integers"),
        ("nothing in it", "in_1.vtu: is empty"),
        ("truncated", "in_1.vtu: is truncated: it does not end with </VTKFile>"),
        ("of another type", "in_1.vtu: is a piece, and not a .vtu file of an unstructured grid"),
        ("listed twice", "./in_0.vtu: stands twice among the pieces"),
        ("no pieces", "it names no pieces of an unstructured grid"),
        ("of another precision", "several types: float64 in in_0.vtu, float32 in in_1.vtu"),
        ("some ids", "in_1.vtu: has no global ids, and other pieces have"),
        ("twice", "in_1.vtu: two of its points have the number"),
        ("apart", "the pieces disagree about the point with the number"),
        ("outside", "in_1.vtu: its cell 0 has a vertex that is not in it"),
        ("no materials", "in_1.vtu: has no cell data 'MaterialIDs', and other pieces have"),
    ],
)
def test_what_is_wrong_with_a_piece_is_one_line_that_names_it(what: str, said: str, tmp_path: Path) -> None:
    path = broken(tmp_path, what)
    with pytest.raises(ReadError) as caught:
        read(path)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_neither_stdin_nor_stdout_has_room_for_pieces(tmp_path: Path) -> None:
    path = made(tmp_path)
    assert "names pieces that are beside it" in error_line("quality", "-", data=path.read_bytes())
    assert "cannot go into a stream" in error_line("untangle", path)
    run("untangle", "-q", "--dry-run", path)
    streamed = run("untangle", "-q", "--format", "vtu", path)
    (tmp_path / "streamed.vtu").write_bytes(streamed.stdout)
    assert read(tmp_path / "streamed.vtu").mesh.check()[0] == 0


def test_in_place_pieces_keep_their_names_and_backups(tmp_path: Path) -> None:
    path = made(tmp_path, names="parts of {stem}/{i} & co.vtu".replace("&", "and"))
    before = {one: one.read_bytes() for one in (path, *pieces(path))}
    run("untangle", "-q", "--backup", path, path)
    assert path.read_bytes() == before[path]
    for one, data in before.items():
        assert one.with_name(f"{one.name}.bak").read_bytes() == data
    assert any(one.read_bytes() != data for one, data in before.items())
    assert read(path).mesh.check()[0] == 0
    assert len(list(tmp_path.rglob("*"))) == 2 * 4 + 1


def test_in_another_folder_pieces_have_the_name_of_the_output(tmp_path: Path) -> None:
    """Else two outputs in one folder might have pieces of the same names."""
    path = made(tmp_path, names="{stem}/{stem}_{i}.vtu")
    before = {one: one.read_bytes() for one in (path, *pieces(path))}
    (tmp_path / "there").mkdir()
    target = tmp_path / "there" / "new.pvtu"
    run("untangle", "-q", path, target)
    assert target.read_text() == path.read_text().replace("in/in_", "new_")
    assert {one.name for one in (tmp_path / "there").iterdir()} == {"new.pvtu", *(f"new_{i}.vtu" for i in range(3))}
    assert {one: one.read_bytes() for one in before} == before
    assert read(target).mesh.check()[0] == 0


def test_in_a_batch_no_mesh_takes_the_pieces_of_another(tmp_path: Path) -> None:
    for folder, name in (("a", "one"), ("b", "two")):
        (tmp_path / folder).mkdir()
        made(tmp_path / folder, names="p_{i}.vtu").rename(tmp_path / folder / f"{name}.pvtu")
    run("batch", "-q", "--jobs", 1, tmp_path / "*/*.pvtu", "--output-dir", tmp_path / "out")
    for name in ("one", "two"):
        assert len(pieces(tmp_path / "out" / f"{name}.pvtu")) == 3
        assert read(tmp_path / "out" / f"{name}.pvtu").mesh.check()[0] == 0
    assert len(list((tmp_path / "out").iterdir())) == 8
    complaint = run("batch", tmp_path / "a/*vtu", "--output-dir", tmp_path / "new", code=2).stderr
    assert re.search(rb"p_0.vtu is a piece of \S+one.pvtu, and an input as well", complaint)
    (tmp_path / "a" / "other.pvtu").write_bytes((tmp_path / "a" / "one.pvtu").read_bytes())
    assert b"one.pvtu as well" in run("batch", tmp_path / "a/*.pvtu", "--output-dir", tmp_path / "new", code=2).stderr
    single = (tmp_path / "b" / "p_1.vtu").rename(tmp_path / "b" / "one_1.vtu")
    complaint = run("batch", tmp_path / "a/one.pvtu", single, "--output-dir", tmp_path / "new", code=2).stderr
    assert b"would both be" in complaint
    assert b"would replace" in run("batch", tmp_path / "a/one.pvtu", "--output-dir", tmp_path / "a", code=2).stderr


def test_a_batch_is_resumed_where_a_piece_is_newer(tmp_path: Path) -> None:
    path, words = made(tmp_path), ("batch", "--json", "--jobs", 1, "--resume")
    for status in ("valid", "skipped"):
        done = run(*words, path, "--output-dir", tmp_path / "out")
        assert json.loads(done.stdout)["status"] == status
    later = (tmp_path / "out" / "in.pvtu").stat().st_mtime_ns + 1_000_000_000
    os.utime(pieces(path)[1], ns=(later, later))
    assert json.loads(run(*words, path, "--output-dir", tmp_path / "out").stdout)["status"] == "valid"


def test_pieces_outside_of_the_folder_get_names_of_their_own(tmp_path: Path) -> None:
    made(tmp_path)
    (tmp_path / "there").mkdir()
    path = index(tmp_path / "there" / "in.pvtu", [f"../in_{i}.vtu" for i in range(3)])
    before = {one: one.read_bytes() for one in pieces(path)}
    (tmp_path / "beyond").mkdir()
    target = tmp_path / "beyond" / 'a "new" & better.pvtu'
    run("untangle", "-q", path, target)
    assert [one.name for one in (tmp_path / "beyond").iterdir() if one.suffix == ".vtu"]
    assert {one: one.read_bytes() for one in before} == before
    read_independently(target)
    assert read(target).mesh.check()[0] == 0


def test_no_piece_of_the_input_is_replaced_but_in_place(tmp_path: Path) -> None:
    path = made(tmp_path, names="out_{i}.vtu")
    for target in ("out.pvtu", "out_1.vtu"):
        assert "name another OUTPUT" in error_line("untangle", path, tmp_path / target)
    assert "name of a mesh" in run("untangle", "--cells", tmp_path / "out_1.vtu", path, path, code=2).stderr.decode()
    beside = "--cells", tmp_path / "new_1.vtu", path, tmp_path / "new.pvtu"
    assert "name of a mesh" in run("untangle", *beside, code=2).stderr.decode()
    assert "name of a mesh" in run("quality", "--cells", tmp_path / "out_1.vtu", path, code=2).stderr.decode()
    assert len(list(tmp_path.iterdir())) == 4
    assert "cannot be made of another" in error_line("untangle", tmp_path / "out_1.vtu", tmp_path / "single.pvtu")


def test_other_formats_get_the_joined_mesh(tmp_path: Path) -> None:
    path = made(tmp_path, ids=True, ghosts=True)
    done = run("untangle", path, tmp_path / "out.vtu")
    assert b"converted from pvtu to vtu" in done.stdout
    mesh = meshio.read(tmp_path / "out.vtu")
    points, cells = block()
    assert len(mesh.points) == len(points)
    assert len(mesh.get_cells_type("tetra")) == len(cells)
    np.testing.assert_array_equal(np.sort(mesh.cell_data["origin"][0].ravel()), np.arange(len(cells)))


def test_single_precision_becomes_double_in_all_files(tmp_path: Path) -> None:
    path, target = made(tmp_path, "plate", "f4"), tmp_path / "out.pvtu"
    repaired(path, target, double=True)
    expected = path.read_text().replace("'in_", "'out_").replace('"Float32" Name="Points"', '"Float64" Name="Points"')
    assert target.read_text() == expected
    assert read_independently(target)[0].dtype == np.float64


def test_the_orientation_is_mended_in_the_pieces(tmp_path: Path) -> None:
    points, cells = block()
    cells = cells.copy()
    cells[[3, 100, 400]] = cells[[3, 100, 400]][:, [1, 0, 2, 3]]
    path = split(tmp_path / "in.pvtu", points, cells, slabs(points, cells, 3))
    assert read(path).mesh.topology.misnumbered.sum() == 3
    assert b"renumbered 3 tetrahedra" in run("untangle", "--fix-orientation", path, tmp_path / "out.pvtu").stdout
    assert read(tmp_path / "out.pvtu").mesh.topology.misnumbered.sum() == 0
    path = split(tmp_path / "in.pvtu", points, cells, slabs(points, cells, 3), ghosts=True)
    with pytest.raises(ReadError, match="has ghost cells"):
        read(path, fix_orientation=True)


def test_arrays_of_the_pieces_hold_points_and_interfaces(tmp_path: Path) -> None:
    path = made(tmp_path)
    free = int(read(path).mesh.movable.sum())
    assert read(path, regions="origin").fixed["between regions of origin"] == free
    assert read(path, fix="height").fixed["by --fix height"] > 0


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="limits of POSIX")
@pytest.mark.parametrize("share", [0.0, 0.9])
def test_a_full_disk_changes_no_piece(share: float, tmp_path: Path) -> None:
    import resource

    points, cells = block()
    piece = np.maximum(slabs(points, cells, 8) - 5, 0)  # the first is the largest
    path = split(tmp_path / "in.pvtu", points, cells, piece, mode="Ascii")
    before = {one.name: one.read_bytes() for one in tmp_path.iterdir()}
    limit = int(share * max(map(len, before.values())))
    for target in (path, tmp_path / "out.pvtu"):
        done = subprocess.run(
            [sys.executable, "-m", "meshfix_cli", "untangle", "-q", "--backup", str(path), str(target)],
            capture_output=True,
            check=False,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
        )
        assert (done.returncode, done.stderr.count(b"\n")) == (1, 1)
        assert b"File too large" in done.stderr
        assert {one.name: one.read_bytes() for one in tmp_path.iterdir()} == before


# The command, with a disk that takes its time once a file is renamed.
SLOW_RENAME = """
import sys, time
from pathlib import Path
replace = Path.replace
def slow(path, target):
    replace(path, target)
    if target.name == "in_1.vtu":
        print("writing", flush=True)
        time.sleep(60)
Path.replace = slow
from meshfix_cli.cli import main
main(sys.argv[1:])
"""


@POSIX
def test_killed_while_it_writes_each_file_is_the_old_or_the_new(tmp_path: Path, random: np.random.Generator) -> None:
    path = made(tmp_path)
    repaired(path, tmp_path / "out.pvtu")
    tangled = {one: one.read_bytes() for one in pieces(path)}
    both = zip(tangled.items(), pieces(tmp_path / "out.pvtu"), strict=True)
    versions = {one: {data, new.read_bytes()} for (one, data), new in both}
    for _ in range(3):
        for one, data in tangled.items():
            one.write_bytes(data)
        with start(WRITES_FOR_EVER, path) as child:
            time.sleep(random.uniform(0, 0.05))
            child.kill()
        assert all(one.read_bytes() in found for one, found in versions.items())


@POSIX
def test_a_signal_between_two_files_leaves_no_mixture(tmp_path: Path) -> None:
    path = made(tmp_path)
    run("untangle", "-q", path, tmp_path / "out.pvtu")
    expected = [one.read_bytes() for one in pieces(tmp_path / "out.pvtu")]
    with start(SLOW_RENAME, "untangle", "-q", path, path) as child:
        child.send_signal(signal.SIGTERM)
        _, complaint = child.communicate(timeout=30)
    assert (child.returncode, complaint.count(b"interrupted while writing")) == (143, 1)
    assert [one.read_bytes() for one in pieces(path)] == expected
    assert len(list(tmp_path.iterdir())) == 8


@POSIX
def test_a_signal_before_the_first_file_is_replaced_changes_none(tmp_path: Path) -> None:
    path = made(tmp_path)
    before = {one.name: one.read_bytes() for one in tmp_path.iterdir()}
    with start(SLOW_DISK, "untangle", "-q", path, path) as child:
        child.send_signal(signal.SIGTERM)
        child.communicate(timeout=30)
    assert child.returncode == 143
    assert {one.name: one.read_bytes() for one in tmp_path.iterdir()} == before
