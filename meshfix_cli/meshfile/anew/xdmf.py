"""XDMF with all numbers in it: one grid, of one type of cells or of several; what tells of groups as meshio has it.

Sets are bytes of 0 and 1, which programs draw; elements `Set` meshio does not read.

Source: XDMF, "XDMF Model and Format"; meshio, "xdmf/main.py".
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any
from xml.sax.saxutils import escape, quoteattr

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.meshfile.anew.content import IN_XML, Content, words_of
from meshfix_cli.meshfile.anew.grid import Arrays, data_of
from meshfix_cli.meshfile.anew.tables import rows_of
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.source import Cells
from meshfix_cli.meshfile.xdmf.cells import HEADS, titled

_KINDS = {"f": "Float", "i": "Int", "u": "UInt"}
_BY_COLUMNS = {1: "Scalar", 3: "Vector", 6: "Tensor6", 9: "Tensor"}


def written(content: Content, form: Format) -> bytes:
    """Return a file."""
    kept = [i for i, run in enumerate(content.cells) if run.type in HEADS and len(run.vertices)]
    if not kept:
        raise content.refusal(form)
    return b"".join(_parts(content, kept))


def _parts(content: Content, kept: list[int]) -> Iterator[bytes]:
    point, cell, about = data_of(content, kept)
    points = np.asarray(content.points, dtype=np.float64)
    yield b'<?xml version="1.0"?>\n<Xdmf Version="3.0">\n<Domain>\n<Grid Name="mesh" GridType="Uniform">\n'
    yield f'<Geometry GeometryType="{"XYZ"[: points.shape[1]]}">\n'.encode()
    yield from _item(points)
    yield b"</Geometry>\n"
    yield from _topology([content.cells[i] for i in kept])
    yield _groups(about)
    for center, arrays in (("Node", point), ("Cell", cell)):
        names = words_of(list(arrays), IN_XML, 1 << 16)
        for name, values in arrays.items():
            columns = 1 if values.ndim == 1 else values.shape[1]
            kind = _BY_COLUMNS.get(columns, "Matrix")
            yield f'<Attribute Name={quoteattr(names[name])} AttributeType="{kind}" Center="{center}">\n'.encode()
            yield from _item(values)
            yield b"</Attribute>\n"
    yield b"</Grid>\n</Domain>\n</Xdmf>\n"


def _topology(cells: Sequence[Cells]) -> Iterator[bytes]:
    """Cells of one type by their vertices; before those of several stands what they are."""
    count = sum(len(run.vertices) for run in cells)
    kind = titled(cells[0].type) if len(cells) == 1 else 'TopologyType="Mixed"'
    yield f'<Topology {kind} NumberOfElements="{count}">\n'.encode()
    tables = [run.vertices.astype(np.int64, copy=False) for run in cells]
    if len(cells) == 1:
        yield from _item(tables[0])
    else:
        heads = [np.tile(HEADS[run.type], (len(run.vertices), 1)) for run in cells]
        tables = [np.column_stack(pair) for pair in zip(heads, tables, strict=True)]
        yield from _item(*tables, shape=str(sum(table.size for table in tables)))
    yield b"</Topology>\n"


def _item(*tables: NDArray[Any], shape: str = "") -> Iterator[bytes]:
    """Give the element of some numbers."""
    dtype = tables[0].dtype
    shape = shape or " ".join(map(str, tables[0].shape))
    kind = f'NumberType="{_KINDS[dtype.kind]}" Precision="{dtype.itemsize}"'
    yield f'<DataItem Dimensions="{shape}" {kind} Format="XML">\n'.encode()
    yield from map(rows_of, tables)
    yield b"</DataItem>\n"


def _groups(about: Arrays) -> bytes:
    if not about:
        return b""
    names = words_of(list(about), IN_XML, 1 << 16)
    quoted = {name: escape(names[name], {'"': "&quot;"}) for name in about}
    maps = [f'<map key="{quoted[name]}" dim="{pair[1]}">{pair[0]}</map>' for name, pair in about.items()]
    return f'<Information Name="groups"><![CDATA[<main>{"".join(maps)}</main>]]></Information>\n'.encode()
