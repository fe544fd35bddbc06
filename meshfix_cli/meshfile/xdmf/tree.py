"""The elements of an XDMF file, and what stands elsewhere in it for others: references and XInclude.

Source: W3C, "XML Path Language (XPath) 1.0", as far as FEniCS, meshio and XDMF's own library use it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.vtk.xml import Element, elements

MOST_STEPS = 16  # from one reference to the next
_STEP = re.compile(r"(//?)([\w.:-]+|\*)((?:\[[^\]]*\])*)")
_POINTER = re.compile(r"\s*(?:xpointer\s*\((.*)\)|(/.*))\s*", re.DOTALL)
_NAMED = re.compile(r"@([\w:]+)\s*=\s*(?:'([^']*)'|\"([^\"]*)\")")
_SELF = re.compile(r"self::([\w:]+)(?:\s+or\s+self::([\w:]+))*")


class Grid(NamedTuple):
    """A grid of cells: its name, whether it is a step in time, and what it consists of."""

    name: str
    timed: bool
    geometry: Element
    topology: Element
    attributes: Sequence[Element]
    sets: Sequence[Element]
    told: Sequence[Element]


def said(element: Element, *names: str) -> str:
    """Return the first of some attributes that an element has, in small letters."""
    return next((element.attributes[name].strip().lower() for name in names if name in element.attributes), "")


class Tree:
    """The elements of a file."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.root, _, self.comments = elements(data, len(data), len(data), "xdmf", "Xdmf", doctype=True)
        if _tag(self.root) != "Xdmf":
            raise ReadError("is not a readable xdmf file: it does not begin with an element Xdmf")

    def grids(self) -> list[Grid]:
        """Return the grids that have cells, in their order.

        Raises
        ------
        ReadError
            There are none, or in several domains.
        """
        domains = self.within(self.root, "Domain")
        if len(domains) != 1:
            several = "holds several domains, and one mesh is read: give each a file of its own"
            raise ReadError(several if domains else "is not a readable xdmf file: it has no domain")
        found = list(self._grids(domains[0], 0))
        if not found:
            raise ReadError("is not a readable xdmf file: it has no grid with points and cells")
        return found

    def _grids(self, parent: Element, depth: int) -> Iterator[Grid]:
        if depth > MOST_STEPS:
            raise ReadError("is not a readable xdmf file: its grids are within too many others")
        for grid in self.within(parent, "Grid"):
            kind = said(grid, "GridType", "Type", "CollectionType") or "uniform"
            if kind in ("collection", "tree", "temporal", "spatial"):
                yield from self._grids(grid, depth + 1)
                continue
            if kind != "uniform":
                raise ReadError(f"has a grid of the type {kind!r}, which is not known")
            geometry, topology = self.within(grid, "Geometry"), self.within(grid, "Topology")
            if geometry and topology:
                attributes, sets = self.within(grid, "Attribute"), self.within(grid, "Set")
                timed, told = bool(self.within(grid, "Time")), self.within(grid, "Information")
                yield Grid(grid.name, timed, geometry[0], topology[0], attributes, sets, told)

    def within(self, element: Element, tag: str) -> list[Element]:
        """Return the elements of a tag in one, also those that stand elsewhere and are included."""
        found = []
        for child in element.children:
            found += self._included(child) if _tag(child) == "include" else [child]
        return [self.resolved(one) for one in found if _tag(one) == tag]

    def resolved(self, element: Element) -> Element:
        """Return the element that one refers to, or itself."""
        for _ in range(MOST_STEPS):
            reference = element.attributes.get("Reference", "").strip()
            if not reference:
                return element
            if reference.upper() == "XML":
                reference = self.data[element.begin : element.end].decode("utf-8", "replace").strip()
            found = self.select(reference)
            if not found:
                raise ReadError(f"is not a readable xdmf file: there is no {reference!r} in it")
            element = found[0]
        raise ReadError("is not a readable xdmf file: its references lead to too many others")

    def _included(self, element: Element) -> list[Element]:
        pointer = _POINTER.fullmatch(element.attributes.get("xpointer", ""))
        if element.attributes.get("href") or pointer is None:
            raise ReadError("includes another file, or what is not an XPath, which meshfix does not read")
        return self.select((pointer[1] or pointer[2]).strip())

    def select(self, path: str) -> list[Element]:
        """Return the elements at an XPath, in their order."""
        found, at = [Element("", {}, 0, 0, children=[self.root])], 0
        while at < len(path):
            step = _STEP.match(path, at)
            if step is None:
                raise ReadError(f"is not a readable xdmf file: the reference {path!r} is of a kind that is not known")
            parents = list(_all(found)) if step[1] == "//" else found
            found = [one for parent in parents for one in _chosen(parent, step[2], step[3], path)]
            at = step.end()
        return found


def _tag(element: Element) -> str:
    """The tag without the name of its space."""
    return element.tag.rpartition(":")[2]


def _all(found: Sequence[Element]) -> Iterator[Element]:
    for element in found:
        yield element
        yield from _all(element.children)


def _chosen(parent: Element, name: str, predicates: str, path: str) -> list[Element]:
    """Return the children of a name that fit all predicates."""
    found = [child for child in parent.children if name in ("*", _tag(child), child.tag)]
    for predicate in re.findall(r"\[([^\]]*)\]", predicates):
        text = predicate.strip()
        if text.isdecimal():
            found = found[int(text) - 1 : int(text)] if int(text) else []
        elif named := _NAMED.fullmatch(text):
            value = named[2] if named[2] is not None else named[3]
            found = [one for one in found if one.attributes.get(named[1]) == value]
        elif _SELF.fullmatch(text):
            tags = re.findall(r"self::([\w:]+)", text)
            found = [one for one in found if _tag(one) in tags]
        else:
            raise ReadError(f"is not a readable xdmf file: the reference {path!r} is of a kind that is not known")
    return found
