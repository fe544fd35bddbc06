"""VTK's XML files of unstructured grids: text, or numbers behind the elements, compressed in blocks.

Source: VTK documentation, "VTK File Formats", section XML Formats; "vtkXMLWriter.cxx".
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.meshfile.anew.content import IN_XML, Content, words_of
from meshfix_cli.meshfile.anew.grid import Grid
from meshfix_cli.meshfile.anew.tables import rows_of
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.vtk.arrays import Coding
from meshfix_cli.meshfile.vtk.xml import TYPES

_BLOCK = 1 << 20
_CODING = Coding("<", 8, None, base64=False)
_LEVEL = 1  # of compression: the others take several times as long, and gain a tenth
_NAMES = {kind: name for name, kind in TYPES.items()}
_HEAD = (
    '<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" '
    'header_type="UInt64"{}>\n<UnstructuredGrid>\n'
)
_COMPRESSED = ' compressor="vtkZLibDataCompressor"'


def written(content: Content, form: Format) -> bytes:
    """Return a file."""
    grid = Grid.of(content, form, old=True)
    text = form.binary is False
    arrays = _Arrays(text)
    kinds = grid.kinds()
    corners = grid.vertices if text else [np.concatenate([rows.ravel() for rows in grid.vertices])]
    cells = [
        arrays.element("connectivity", *corners, scalars=True), arrays.element("offsets", grid.offsets()),
        arrays.element("types", kinds),
    ]  # fmt: skip
    parts = [
        _HEAD.format("" if text else _COMPRESSED).encode(),
        arrays.section("FieldData", grid.about, ' NumberOfTuples="2"'),
        f'<Piece NumberOfPoints="{len(grid.points)}" NumberOfCells="{len(kinds)}">\n<Points>\n'.encode(),
        arrays.element("Points", grid.points),
        b"</Points>\n<Cells>\n", *cells, b"</Cells>\n",
        arrays.section("PointData", grid.point), arrays.section("CellData", grid.cell),
        b"</Piece>\n</UnstructuredGrid>\n",
    ]  # fmt: skip
    if not text:
        parts += [b'<AppendedData encoding="raw">\n_', *arrays.appended, b"\n</AppendedData>\n"]
    return b"".join([*parts, b"</VTKFile>\n"])


class _Arrays:
    """The arrays of a file, of which it gives the elements, and what stands behind all of them."""

    def __init__(self, text: bool) -> None:
        self.text, self.appended, self.size = text, list[bytes](), 0

    def section(self, tag: str, arrays: Mapping[str, NDArray[Any]], more: str = "") -> bytes:
        """Return the element of some arrays."""
        names = words_of(list(arrays), IN_XML, 1 << 16)
        parts = [self.element(names[name], values, more=more) for name, values in arrays.items()]
        return f"<{tag}>\n".encode() + b"".join(parts) + f"</{tag}>\n".encode() if parts else b""

    def element(self, name: str, *tables: NDArray[Any], more: str = "", scalars: bool = False) -> bytes:
        """Return the element of an array; text may come in several parts, and scalars in rows."""
        (values, *_) = tables
        columns = values.shape[1] if len(tables) == 1 and values.ndim > 1 and not scalars else 1
        said = f' NumberOfComponents="{columns}"' if columns > 1 else ""
        head = f'<DataArray type="{_NAMES[values.dtype.str[1:]]}" Name={quoteattr(name)}{said}{more} format='
        if self.text:
            return b"".join([f'{head}"ascii">\n'.encode(), *map(rows_of, tables), b"</DataArray>\n"])
        begin, data = self.size, _compressed(values)
        self.appended.append(data)
        self.size += len(data)
        return f'{head}"appended" offset="{begin}"/>\n'.encode()


def _compressed(values: NDArray[Any]) -> bytes:
    body = values.astype(values.dtype.newbyteorder("<"), copy=False).tobytes()
    blocks = [zlib.compress(body[at : at + _BLOCK], _LEVEL) for at in range(0, len(body), _BLOCK)]
    header = _CODING.header([len(blocks), _BLOCK, len(body) % _BLOCK, *map(len, blocks)])
    return b"".join([header, *blocks])
