"""Polydata in several files of VTK: joined, solved as one, and each piece written back; VTK is the oracle."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from files_pvtp import read_independently, split
from shapes import plate
from splicing import WORD, repaired

from meshfix_cli import read
from meshfix_cli.errors import ReadError


@pytest.mark.parametrize("dtype", ["f4", "f8"])
def test_pieces_are_solved_as_one_mesh(dtype: str, tmp_path: Path) -> None:
    path, target = split(tmp_path / "in.pvtp", dtype=dtype), tmp_path / "out.pvtp"
    document, _ = repaired(path, target)
    points, cells = plate()
    assert document.mesh.topology.m == len(cells)
    assert document.mesh.topology.n == len(points)
    before, others_before = read_independently(path)
    after, others_after = read_independently(target)
    np.testing.assert_equal(others_after, others_before)
    assert (before != after).any()
    assert target.read_text() == path.read_text().replace('"in_', '"out_')
    for i in range(3):
        old, new = (WORD.split((tmp_path / f"{name}_{i}.vtp").read_bytes()) for name in ("in", "out"))
        assert old[::2] == new[::2]


def test_single_precision_becomes_double(tmp_path: Path) -> None:
    path, target = split(tmp_path / "in.pvtp", dtype="f4"), tmp_path / "out.pvtp"
    repaired(path, target, double=True)
    assert read_independently(target)[0].dtype == np.float64
    assert 'type="Float64" Name="Points"' in target.read_text()


def test_a_piece_of_another_type_is_refused(tmp_path: Path) -> None:
    path = split(tmp_path / "in.pvtp")
    (tmp_path / "in_1.vtp").write_text('<VTKFile type="UnstructuredGrid"></VTKFile>')
    with pytest.raises(ReadError, match=r"in_1.vtp: is a piece, and not a .vtp file of polydata"):
        read(path)
    path.write_text('<VTKFile type="PPolyData"><PPolyData></PPolyData></VTKFile>')
    with pytest.raises(ReadError, match="is not a readable pvtp file: it names no pieces of polydata"):
        read(path)
