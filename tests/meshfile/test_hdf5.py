"""Data sets of HDF5 in every way that they are stored, written by h5py and read back by it."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile import hdf5
from meshfix_cli.meshfile.hdf5 import Table
from meshfix_cli.meshfile.source import Layout
from meshfix_cli.meshfile.splice import InPlace, Turned

h5py = pytest.importorskip("h5py")
N = 57
# How the coordinates are stored, and whether they stand in the bytes as they are.
STORED: dict[str, tuple[dict[str, Any], bool]] = {
    "contiguous": ({}, True),
    "big endian": ({"dtype": ">f8"}, True),
    "single": ({"dtype": "<f4"}, True),
    "big endian and single": ({"dtype": ">f4"}, True),
    "chunks": ({"chunks": (10, 2)}, True),
    "one chunk": ({"chunks": (N, 3)}, True),
    "small chunks": ({"chunks": (1, 1), "dtype": ">f4"}, True),
    "endless": ({"chunks": (8, 3), "maxshape": (None, 3)}, True),
    "compressed": ({"chunks": (10, 2), "compression": "gzip"}, False),
    "shuffled": ({"chunks": (10, 3), "shuffle": True, "dtype": ">f4"}, False),
    "checked": ({"chunks": (10, 3), "fletcher32": True}, False),
}


def coordinates(dtype: str = "<f8") -> NDArray[Any]:
    return np.random.default_rng(7).random((N, 3)).astype(dtype)


def file_of(fill: Callable[[Any], None], **options: Any) -> bytes:
    stream = io.BytesIO()
    with h5py.File(stream, "w", **options) as file:
        file["before"] = np.arange(1000)
        fill(file)
        file["behind"] = np.arange(3000.0)
        file["behind"].attrs["unit"] = "m"
    return stream.getvalue()


def stored(file: Any, kind: str) -> None:
    options = STORED[kind][0]
    values = coordinates(options.get("dtype", "<f8"))
    file.create_group("mesh").create_dataset("points", data=values, **options)
    file.create_dataset("mesh/cells", data=np.arange(40, dtype="i4").reshape(10, 4))
    file.create_dataset("mesh/packed", data=np.arange(40).reshape(4, 10), compression="gzip")


def layout_of(data: bytes, points: Table, corners: Any = ()) -> tuple[Layout, NDArray[Any]]:
    with hdf5.opened(data, "test") as root:
        return hdf5.layout(root, data, "test", points, corners), points.read(root)


def content(data: bytes) -> dict[str, Any]:
    found = {}

    def visit(name: str, item: Any) -> None:
        found[name] = (item[()] if isinstance(item, h5py.Dataset) else None, dict(item.attrs))

    with h5py.File(io.BytesIO(data)) as file:
        file.visititems(visit)
    return found


@pytest.mark.parametrize("kind", STORED)
@pytest.mark.parametrize("options", [{}, {"userblock_size": 1024}, {"libver": "latest"}], ids=["old", "block", "new"])
def test_only_the_coordinates_that_moved_are_other(kind: str, options: dict[str, Any]) -> None:
    data = file_of(partial(stored, kind=kind), **options)
    layout, points = layout_of(data, Table.by_row("/mesh/points", N, 3))
    np.testing.assert_array_equal(points, coordinates(points.dtype.str))
    assert isinstance(layout, InPlace) == STORED[kind][1]
    moved = points.copy()
    moved[::5, 1] += 0.25
    moved[11, 2] = np.nan  # stays as it was
    new = layout.rewritten(points, moved, {})
    expected = content(data)
    expected["mesh/points"][0][::5, 1] = moved[::5, 1]
    np.testing.assert_equal(content(new), expected)
    if STORED[kind][1]:
        assert len(new) == len(data)
        changed = np.frombuffer(data, np.uint8) != np.frombuffer(new, np.uint8)
        assert 0 < changed.sum() <= len(points[::5]) * points.itemsize
    assert layout.rewritten(points, points, {}) == data


def test_a_data_set_in_its_header() -> None:
    def compact(file: Any) -> None:
        kind = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        kind.set_layout(h5py.h5d.COMPACT)
        space = h5py.h5s.create_simple((4, 3))
        one = h5py.h5d.create(file.id, b"points", h5py.h5t.IEEE_F64LE, space, kind)
        one.write(h5py.h5s.ALL, h5py.h5s.ALL, np.arange(12.0).reshape(4, 3))

    data = file_of(compact)
    layout, points = layout_of(data, Table.by_row("points", 4, 3))
    assert not isinstance(layout, InPlace)
    np.testing.assert_array_equal(content(layout.rewritten(points, points * 2, {}))["points"][0], points * 2)


def test_chunks_that_were_never_written_are_zero_and_can_be_moved() -> None:
    def sparse(file: Any) -> None:
        file.create_dataset("points", (30, 3), "f8", chunks=(10, 3))[:10] = 1.0

    data = file_of(sparse)
    layout, points = layout_of(data, Table.by_row("points", 30, 3))
    assert points[10:].max() == 0
    np.testing.assert_array_equal(content(layout.rewritten(points, points + 1, {}))["points"][0], points + 1)


@pytest.mark.parametrize("compression", [None, "gzip"])
def test_columns_of_one_data_set_or_of_several(compression: str | None) -> None:
    def columns(file: Any) -> None:
        file.create_dataset("all", data=coordinates().T.ravel(), compression=compression)
        for name, column in zip("xyz", coordinates().T, strict=True):
            file.create_dataset(name, data=column, compression=compression)

    data = file_of(columns)
    for sets in (["all"], ["x", "y", "z"]):
        layout, points = layout_of(data, Table.by_column(sets, N, 3))
        np.testing.assert_array_equal(points, coordinates())
        back = layout_of(layout.rewritten(points, points + np.arange(3), {}), Table.by_column(sets, N, 3))[1]
        np.testing.assert_array_equal(back, points + np.arange(3))


@pytest.mark.parametrize("kind", ["contiguous", "compressed"])
@pytest.mark.parametrize(
    "cells", [Table.by_row("/mesh/cells", 10, 4), Table.by_column(["/mesh/packed"], 10, 4)], ids=["plain", "packed"]
)
def test_cells_are_turned(kind: str, cells: Table) -> None:
    data = file_of(partial(stored, kind=kind))
    layout, points = layout_of(data, Table.by_row("/mesh/points", N, 3), [lambda: cells])
    new = layout.rewritten(points, points, {0: Turned(np.array([0, 7]), (1, 0, 2, 3))})
    expected = content(data)
    flat = expected[cells.sets[0].strip("/")][0].reshape(-1)
    flat[cells.at[[0, 7], :2]] = flat[cells.at[[0, 7], 1::-1]]
    np.testing.assert_equal(content(new), expected)


def test_coordinates_of_two_types_or_of_none() -> None:
    def mixed(file: Any) -> None:
        file["x"], file["y"], file["half"] = np.zeros(4), np.zeros(4, "f4"), np.zeros(4, "f2")

    data = file_of(mixed)
    for sets in (["x", "y"], ["half", "half"]):
        with pytest.raises(ReadError, match="not all of single or of double precision"):
            layout_of(data, Table.by_column(sets, 4, 2))


def test_what_stands_in_other_files_is_refused(tmp_path: Path) -> None:
    secret = tmp_path / "other.h5"
    with h5py.File(secret, "w") as file:
        file["points"] = np.zeros((4, 3))

    def linked(file: Any) -> None:
        file["link"] = h5py.ExternalLink(str(secret), "/points")
        file["soft"] = h5py.SoftLink("/link")
        file["round"] = h5py.SoftLink("/about")
        file["about"] = h5py.SoftLink("/round")
        file.create_dataset("outside", (4, 3), "f8", external=[(str(tmp_path / "raw"), 0, 96)])
        virtual = h5py.VirtualLayout((4, 3), "f8")
        virtual[:] = h5py.VirtualSource(str(secret), "points", (4, 3))
        file.create_virtual_dataset("virtual", virtual)
        file["here"] = h5py.SoftLink("/before")

    data = file_of(linked)
    with hdf5.opened(data, "test") as root:
        for path, words in (
            ("link", "into another file"), ("soft", "into another file"), ("round", "too many others"),
            ("outside", "stored in other files"), ("virtual", "stored in other files"),
        ):  # fmt: skip
            with pytest.raises(ReadError, match=words):
                hdf5.data_set(root, path)
        assert hdf5.data_set(root, "here").shape == (1000,)
        assert hdf5.data_set(root, "no/such") is None
        assert hdf5.data_set(root, "before/no") is None
        assert hdf5.group(root, "before") is None


def test_a_size_that_is_announced_is_not_believed() -> None:
    def huge(file: Any) -> None:
        file.create_dataset("points", (10**12, 3), "f8", chunks=(10, 3))[0] = 1

    with hdf5.opened(file_of(huge), "test") as root, pytest.raises(ReadError, match="announces more than is stored"):
        hdf5.data_set(root, "points")


def test_broken_files_and_other_types() -> None:
    data = file_of(partial(stored, kind="contiguous"))
    for broken in (data[:200], data[:-1000], data[:9] + bytes(90) + data[99:]):
        with pytest.raises(ReadError, match="is not a readable test file"):
            layout_of(broken, Table.by_row("/mesh/points", N, 3))
    with hdf5.opened(data, "test") as root:
        with pytest.raises(ReadError, match="does not hold integers"):
            hdf5.numbers(hdf5.data_set(root, "mesh/points"), "iu")
        assert hdf5.attribute(hdf5.data_set(root, "behind"), "unit") == "m"
        assert hdf5.attribute(root, "none", 3) == 3


def test_without_h5py(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(ReadError, match=r"needs h5py: pip install 'meshfix-cli\[hdf5\]'"), hdf5.opened(b"", "test"):
        pass
