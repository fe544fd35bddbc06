"""Coordinates in legacy .vtk files, ASCII and binary, float and double.

Source: "VTK File Formats", section Simple Legacy Formats.
"""

from __future__ import annotations

import re

import numpy as np

from meshfix_cli.meshfile.splice import Places, binary_places, text_places

_TYPES = {b"float": "f4", b"double": "f8"}


def find_coordinates(data: bytes) -> Places | None:
    """Find the points; None: not in the form this module knows."""
    head = data.split(b"\n", 3)
    points = re.search(rb"(?im)^[ \t]*POINTS[ \t]+(\d+)[ \t]+(\w+)[ \t]*\r?\n", data)
    if points is None or len(head) < 4 or points[2].lower() not in _TYPES:
        return None
    count, kind = int(points[1]), _TYPES[points[2].lower()]
    if head[2].strip().upper() == b"BINARY":
        width = 3 * np.dtype(kind).itemsize
        return binary_places(points.end() + width * np.arange(count, dtype=np.int64), f">{kind}")
    words = re.compile(rb"\S+").finditer(data, points.end())
    spans = [span for _, word in zip(range(3 * count), words, strict=False) for span in word.span()]
    return text_places(list(zip(*[iter(spans)] * 6, strict=True)), kind) if len(spans) == 6 * count else None
