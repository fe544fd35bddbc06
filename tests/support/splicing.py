"""What is compared of a file before and after: the makers of each format, and bytes without coordinates."""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from meshfix_cli import read, untangle, write
from meshfix_cli.meshfile.document import Document
from meshfix_cli.meshfile.formats import OWN

IN_SEVERAL_FILES = ("pvtu", "pvtp", "vtm", "openfoam", "tetgen", "elmer")  # which have tables of their own
FORMATS = tuple(name for name in OWN if name not in IN_SEVERAL_FILES)
MODULES = {name: importlib.import_module(f"files_{name.replace('-', '_')}") for name in FORMATS}
WORD = re.compile(rb"([^\s,\"'=<>]+)")


def make(form: str, variant: str, folder: Path) -> Path:
    path = folder / variant
    makers: dict[str, Callable[[Path], None]] = MODULES[form].FILES
    makers[variant](path)
    return path


def value(word: bytes) -> float:
    """A number, as Fortran and Nastran may write it: the exponent after D, or after nothing but its sign."""
    return float(re.sub(rb"(?<=[\d.])(?=[+-])", b"e", word.replace(b"D", b"e").strip() or b"0"))


def pieces(form: str, variant: str, data: bytes) -> list[bytes]:
    """Words, and what stands between them; of files whose numbers fill columns, fields by their columns."""
    module = MODULES[form]
    return module.fields(data) if variant in getattr(module, "PADDED", ()) else WORD.split(data)


def repaired(path: Path | str, target: Path | str, **options: Any) -> tuple[Document, np.ndarray]:
    """Untangle a file; the document, and the points as the new file must have them."""
    document = read(path, **options)
    outcome = untangle(document.mesh)
    assert outcome.records[0].inverted > 0
    assert outcome.valid
    result, dropped = write(document, outcome.after, target)
    assert dropped == ()
    assert result.check()[0] == 0
    return document, document.file_points(outcome.after)


def without_points(data: bytes) -> bytes:
    """A .vtu file without the arrays of its points, and without the offsets, which depend on their lengths."""
    head, _, tail = data.partition(b"<AppendedData")
    start, end = tail.find(b"_") + 1, tail.rfind(b"</AppendedData")
    points = [found.span() for found in re.finditer(rb"(?s)<Points>.*?</Points>", head)]
    assert points
    offsets = [(int(found[1]), found.start()) for found in re.finditer(rb'offset="(\d+)"', head)]
    ends = [offset for offset, _ in offsets[1:]] + [end - start]
    assert offsets == sorted(offsets)
    kept = [re.sub(rb'(?s)<Points>.*?</Points>|offset="\d+"', b"", head), tail[:start], tail[end:]]
    for (offset, at), last in zip(offsets, ends, strict=False):
        if not any(first < at < behind for first, behind in points):
            kept.append(tail[start + offset : start + last])
    return b"|".join(kept)
