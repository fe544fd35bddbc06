"""The mark of UTF-8 in front of texts, which Windows' programs write: it says nothing, and stays."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from splicing import FORMATS, MODULES, make

from meshfix_cli import read
from meshfix_cli.meshfile.reading import parse

MARK = b"\xef\xbb\xbf"


@pytest.mark.parametrize("form", FORMATS)
def test_a_mark_in_front_of_a_text_says_nothing(form: str, tmp_path: Path) -> None:
    for variant in MODULES[form].FILES:
        path = make(form, variant, tmp_path)
        data = path.read_bytes()
        if b"\0" in data:
            continue
        expected = read(path)
        path.write_bytes(MARK + data)
        found = read(path)
        assert found.format == expected.format
        assert found.source.points.tobytes() == expected.source.points.tobytes()
        for one, other in zip(found.source.cells, expected.source.cells, strict=True):
            assert one.type == other.type
            assert all(map(np.array_equal, one.vertices, other.vertices))
        if (layout := found.source.layout) is not None:
            moved = layout.rounded(found.source.points * 1.25)
            back = layout.rewritten(found.source.points, moved, {})
            assert back.startswith(MARK)
            assert parse(back, found.format, path).points.tobytes() == moved.tobytes()
