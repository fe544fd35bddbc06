"""meshio behind a wall: what it prints is swallowed, what it raises becomes one sentence, what it writes is checked."""

from __future__ import annotations

import contextlib
import io
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import MeshfixError, ReadError, WriteError
from meshfix_cli.meshfile import formats
from meshfix_cli.meshfile.formats import Format

SIMPLEX = {2: "triangle", 3: "tetra"}
ROUNDING = 1e-4  # relative to the size of the mesh: more than any format rounds, less than any mesh can bear


def read_bytes(data: bytes, form: Format) -> Any:
    """Read what came from a stream; meshio wants a file."""
    with tempfile.TemporaryDirectory(prefix="meshfix-") as folder:
        path = Path(folder) / "stream"
        path.write_bytes(data)
        return read_path(path, form)


def read_path(path: Path, form: Format) -> Any:
    """Read a file; the arrays come in the machine's byte order."""
    with _sentences(ReadError, f"is not a readable {form.name} file"):
        source = meshio.read(path, file_format=form.reader)
        missing = formats.missing_part(path, form, sum(len(block.data) for block in source.cells))
        _make_native(source)
    if missing:
        raise ReadError(f"is truncated: {missing}")
    return source


def write_path(path: Path, source: Any, form: Format, dimension: int) -> NDArray[np.float64]:
    """Write a file and read it again; return the points (n, 3) as it holds them.

    Raises
    ------
    WriteError
        The format cannot hold the simplices of this dimension, or rounds them too much.
    """
    out = source.copy()
    if form.reader != "gmsh":  # these mean nothing elsewhere, and break some writers
        out.point_data.pop("gmsh:dim_tags", None)
        out.cell_sets.pop("gmsh:bounding_entities", None)
    if form.name == "stl":
        out.cell_data.pop("facet_normals", None)  # they were those of the mesh before
    with _sentences(WriteError, f"cannot be written as {form.name}"):
        meshio.write(path, out, file_format=form.name, **formats.options(form))
    if len(list(path.parent.iterdir())) > 1:
        raise WriteError(f"cannot be written as {form.name}: it takes more than one file")
    expected = simplices_of(source, dimension)
    points = np.array(source.points, dtype=np.float64)
    size = float(np.ptp(points[expected], axis=(0, 1)).max())
    try:
        back = read_path(path, form)
        corners = _spatial(back.points)[simplices_of(back, dimension)]
        difference = np.abs(corners - _spatial(points)[expected]).max()
    except (MeshfixError, IndexError, ValueError) as error:
        raise WriteError(f"cannot be written as {form.name}: what was written does not read back") from error
    if not difference <= ROUNDING * size:
        raise WriteError(f"cannot be written as {form.name}: the coordinates do not read back")
    points[expected] = corners[:, :, : points.shape[1]]
    return points


def simplices_of(source: Any, dimension: int) -> NDArray[np.int64]:
    """Return all simplices (m, d+1) in the order of the file."""
    blocks = [block.data for block in source.cells if block.type == SIMPLEX[dimension]]
    return np.concatenate(blocks or [np.empty((0, dimension + 1), dtype=np.int64)])


def _spatial(points: Any) -> NDArray[np.float64]:
    """Points with three coordinates."""
    p = np.asarray(points, dtype=np.float64)
    return np.hstack([p, np.zeros((len(p), 3 - p.shape[1]))]) if p.shape[1] < 3 else p


@contextlib.contextmanager
def _sentences(kind: type[MeshfixError], what: str) -> Iterator[None]:
    """Turn whatever meshio raises into one sentence; also its sys.exit, for which it prints the reason."""
    printed = io.StringIO()
    try:
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
            yield
    except ImportError as error:
        raise kind(f"{what}: that needs the package {error.name}") from error
    except OSError:
        raise
    except (Exception, SystemExit) as error:
        said = printed.getvalue().strip() if isinstance(error, SystemExit) else str(error).strip()
        reason = " ".join(said.split())[:200] or f"{type(error).__name__} in meshio"
        raise kind(f"{what} ({reason})") from error


def _make_native(source: Any) -> None:
    """Turn arrays to the machine's byte order: readers of binary files leave them as they were there."""

    def native(array: Any) -> Any:
        return array.astype(array.dtype.newbyteorder("=")) if isinstance(array, np.ndarray) else array

    source.points = native(source.points)
    for block in source.cells:
        block.data = native(block.data)
    source.point_data = {name: native(data) for name, data in source.point_data.items()}
    source.cell_data = {name: [native(data) for data in blocks] for name, blocks in source.cell_data.items()}
