"""Coordinates in Wavefront .obj files.

Source: the lines `v x y z [w | r g b]` of the Wavefront OBJ specification.
"""

from __future__ import annotations

import re

from meshfix_cli.meshfile.splice import Places, text_places

_VERTEX = re.compile(rb"^[ \t]*v[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", re.MULTILINE)


def find_coordinates(data: bytes) -> Places | None:
    """Find the vertices in the order of their numbers."""
    spans = [(*v.span(1), *v.span(2), *v.span(3)) for v in _VERTEX.finditer(data)]
    return text_places(spans, "f8") if spans else None
