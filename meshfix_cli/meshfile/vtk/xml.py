"""The frame of VTK's XML files: their elements, where these stand in the bytes, and where their arrays do.

Source: VTK documentation, "VTK File Formats", section XML Formats.
"""

from __future__ import annotations

import re
from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import accumulate
from xml.parsers import expat

import numpy as np

from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.splice import Edits, apply
from meshfix_cli.meshfile.vtk.arrays import COMPRESSORS, Coding, Kind, Numbers, Payload, Text, replacement

# numpy's names of the types; strings and bits are not among them.
TYPES = {f"{kind}{8 * size}": f"{kind[0].lower()}{size}" for kind in ("Int", "UInt") for size in (1, 2, 4, 8)}
TYPES |= {"Float32": "f4", "Float64": "f8"}

_ATTRIBUTES = rb"""(?:[^<>"']|"[^"<]*"|'[^'<]*')*"""
_TAG = re.compile(rb"<%b>" % _ATTRIBUTES)
_ATTRIBUTE = re.compile(rb"""([^\s=<>"'/]+)\s*=\s*["']((?<=")[^"<]*|(?<=')[^'<]*)["']""")
_APPENDED = re.compile(rb"<!--(?s:.*?)(?:-->|\Z)|(<AppendedData(?=[\s>])%b>)" % _ATTRIBUTES)
_UNDERSCORE = re.compile(rb"\s*_")


@dataclass(eq=False)
class Element:
    """An element of the file.

    Attributes
    ----------
    tag : str
    attributes : mapping
    at : int
        Offset of its `<`.
    begin, end : int
        Its text, up to the first element in it.
    children : list of Element
    """

    tag: str
    attributes: Mapping[str, str]
    at: int
    begin: int
    end: int = -1
    children: list[Element] = field(default_factory=list)

    @property
    def name(self) -> str:
        """What the file calls it."""
        return self.attributes.get("Name", "")

    @property
    def kind(self) -> str | None:
        """numpy's name of the type of its numbers; None: they are not numbers."""
        return TYPES.get(self.attributes.get("type", ""))

    @property
    def appended(self) -> bool:
        """Whether its numbers stand behind all elements."""
        return self.attributes.get("format") == "appended"

    def named(self, *path: str) -> list[Element]:
        """Return the elements in it that are reached by a path of tags."""
        found = [self]
        for tag in path:
            found = [child for element in found for child in element.children if child.tag == tag]
        return found

    def count(self, attribute: str) -> int:
        """Return the number that an attribute holds."""
        text = self.attributes.get(attribute, "").strip(" \t\r\n")
        if not re.fullmatch("[0-9]{1,15}", text):
            raise ReadError(f"is not a readable VTK file: the {attribute} of a {self.tag} is {text!r}")
        return int(text)


@dataclass(frozen=True, eq=False)
class XmlFile:
    """A file of VTK in XML.

    Attributes
    ----------
    data : bytes
    root : Element
    arrays : sequence of Element
        All whose numbers are appended.
    comments : bool
        Whether there are any.
    begin, end : int
        The appended data, to which the offsets of arrays are relative.
    """

    data: bytes
    root: Element
    arrays: Sequence[Element]
    comments: bool
    begin: int
    end: int

    @classmethod
    def parse(cls, data: bytes) -> XmlFile:
        """Read the elements.

        Raises
        ------
        ReadError
            They are not well-formed, or the file does not end as it should.
        """
        found = _APPENDED.finditer(data) if b"<AppendedData" in data else ()
        tag = next((match for match in found if match[1]), None)
        if tag is None:
            file = cls(data, *elements(data, len(data), len(data)), 0, 0)
            if file.arrays:
                raise ReadError("is not a readable VTK file: it has no appended data")
            return file
        end = data.rfind(b"</AppendedData")
        if end < tag.end():
            raise ReadError("is truncated: its appended data do not end")
        start = _UNDERSCORE.match(data, tag.end(), end)
        if start is None:
            raise ReadError("is not a readable VTK file: its appended data do not begin with an underscore")
        parsed = elements(data, tag.end(), end)
        if [element.at for element in parsed[0].named("AppendedData")] != [tag.start()]:
            raise ReadError("is not a readable VTK file: its appended data are not where they should be")
        file = cls(data, *parsed, start.end(), end)
        if file._offsets and file._offsets[-1] > end - file.begin:
            raise ReadError("is truncated: its appended data end before its last array begins")
        return file

    @cached_property
    def _appended_in_base64(self) -> bool:
        return self.root.named("AppendedData")[0].attributes.get("encoding") != "raw"

    def numbers(self, array: Element, size: int) -> Numbers:
        """Return the numbers of an array of which there are `size`.

        Raises
        ------
        ReadError
            There are more or less.
        """
        if array.kind is None:
            raise ReadError(f"is not a readable VTK file: its array {array.name!r} does not hold numbers")
        kind = Kind(array.name, array.kind, size)
        if array.appended:
            at = self.begin + array.count("offset")
            behind = bisect_right(self._offsets, at - self.begin)
            end = self.begin + self._offsets[behind] if behind < len(self._offsets) else self.end
            return Payload.appended(self.data, at, end, kind, self._coding(self._appended_in_base64))
        if array.attributes.get("format") == "binary":
            return Payload.inline(self.data, array.begin, array.end, kind, self._coding(base64=True))
        return Text(self.data, array.begin, array.end, kind)

    def _coding(self, base64: bool) -> Coding:
        attributes = self.root.attributes
        order = {"LittleEndian": "<", "BigEndian": ">"}.get(attributes.get("byte_order", "LittleEndian"))
        width = {"UInt32": 4, "UInt64": 8}.get(attributes.get("header_type", "UInt32"))
        name = attributes.get("compressor")
        if order is None or width is None or (name and name not in COMPRESSORS):
            raise ReadError("is not a readable VTK file: its byte_order, header_type or compressor is not known")
        return Coding(order, width, COMPRESSORS[name] if name else None, base64)

    def shares(self, array: Element) -> bool:
        """Whether another array has the same bytes."""
        offset = array.count("offset") if array.appended else -1
        return bisect_right(self._offsets, offset) - bisect_left(self._offsets, offset) > 1

    @cached_property
    def _offsets(self) -> list[int]:
        return sorted(array.count("offset") for array in self.arrays)

    def attribute(self, element: Element, name: str, value: str) -> Edits:
        """Return the edit that changes the value of an attribute, but not the blanks around it."""
        tag = _TAG.match(self.data, element.at)
        found = _ATTRIBUTE.finditer(self.data, element.at, tag.end() if tag else element.at)
        match = next(match for match in found if match[1] == name.encode())
        old, begin = match[2], match.start(2)
        begin += len(old) - len(old.lstrip())
        return replacement(begin, begin + len(old.strip()), value.encode())

    def edited(self, edits: Sequence[Edits]) -> bytes:
        """Return the file with edits made, and with the offsets of the arrays behind one that grew."""
        if not edits:
            return self.data
        grown = sorted(
            (int(edit.spans[0, 0]) - self.begin, len(edit.words) - int(np.ptp(edit.spans[0])))
            for edit in edits
            if len(edit.spans) and edit.spans[0, 0] >= self.begin > 0
        )
        total = [0, *accumulate(growth for _, growth in grown)]
        shifts = []
        for array in self.arrays if any(total) else ():
            offset = array.count("offset")
            shift = total[bisect_left(grown, (offset,))]
            if shift:
                shifts.append(self.attribute(array, "offset", str(offset + shift)))
        return apply(self.data, [*edits, *shifts])


def elements(
    data: bytes, head: int, tail: int, form: str = "VTK", root: str = "VTKFile", doctype: bool = False
) -> tuple[Element, list[Element], bool]:
    """Read the elements before `head` and from `tail`: the root, those with appended arrays, and if there are comments.

    Between the two may be anything, also what is not XML.

    Parameters
    ----------
    form : str
        What the file is called in sentences.
    root : str
        The tag with which it ends.
    doctype : bool
        Whether a document type may be declared; nothing that stands for something else may be.

    Raises
    ------
    ReadError
        They are not well-formed.
    """
    parser = expat.ParserCreate()
    stack = [Element("", {}, 0, 0)]
    arrays: list[Element] = []
    comments: list[str] = []

    def position() -> int:
        at = parser.CurrentByteIndex
        return at if at < head else at + tail - head

    def start(tag: str, attributes: dict[str, str]) -> None:
        at = position()
        match = _TAG.match(data, at)
        if match is None or not data.startswith(b"<" + tag.encode(), at):  # UTF-16, for one
            raise ReadError(f"is not a readable {form} file: its tags are not where they should be")
        if stack[-1].end < 0:
            stack[-1].end = at
        element = Element(tag, attributes, at, match.end())
        stack[-1].children.append(element)
        stack.append(element)
        if element.appended:
            arrays.append(element)

    def end(tag: str) -> None:
        element = stack.pop()
        if element.end < 0:
            element.end = max(position(), element.begin)

    def refuse(*_: object) -> None:
        raise ReadError(f"is not a readable {form} file: it has a document type declaration")

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CommentHandler = comments.append
    if doctype:
        parser.EntityDeclHandler = refuse
    else:
        parser.StartDoctypeDeclHandler = refuse
    view = memoryview(data)
    try:
        parser.Parse(view[:head], False)
        parser.Parse(view[tail:], True)
    except expat.ExpatError as error:
        if f"</{root}".encode() not in data[-4096:]:
            raise ReadError(f"is truncated: it does not end with </{root}>") from error
        raise ReadError(f"is not a readable {form} file: {error}") from error
    except (LookupError, ValueError) as error:
        raise ReadError(f"is not a readable {form} file: its encoding is not known ({error})") from error
    return stack[0].children[0], arrays, bool(comments)
