"""Abaqus .inp files: elements by their type, sets of elements and of nodes, and a section for each material.

Source: Dassault Systèmes, "Abaqus Keywords Reference Guide" and "Input Syntax Rules".
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from meshfix_cli.mesh.elements import dimension_of
from meshfix_cli.meshfile.abaqus import PLANES, SOLIDS
from meshfix_cli.meshfile.anew.content import Content, Int64, words_of
from meshfix_cli.meshfile.anew.tables import integers, numbered
from meshfix_cli.meshfile.recognise import Format

_SHELLS = {"triangle": "S3", "quad": "S4", "triangle6": "STRI65", "quad8": "S8R", "quad9": "S9R5"}
HELD = ("line", *_SHELLS, *SOLIDS.values())
MOST = 999_999_999
_ON_LINE, _LONGEST = 16, 20  # numbers, and characters of a number
Sets = dict[str, list[Int64]]


def written(content: Content, _: Format) -> bytes:
    """Return a file; elements of the highest dimension have a section, which tells their material."""
    types = _types(content)
    points = np.asarray(content.points, dtype=np.float64)
    parts = [b"*HEADING\nMesh\n*NODE\n", numbered(content.nodes, points, ",", _LONGEST)]
    for run, mine in zip(content.cells, content.elements, strict=True):
        if run.type in HELD and len(mine):
            parts.append(f"*ELEMENT, TYPE={types[run.type]}\n".encode())
            parts.append(integers(mine, content.nodes_of(run.vertices), between=", ", longest=_ON_LINE))
    materials, elements, nodes = _sets(content)
    words = _words([*dict.fromkeys([*materials, *elements, *nodes])])
    parts += [_set("ELSET", words[name], numbers) for name, numbers in (materials | elements).items()]
    parts += [_set("NSET", words[name], numbers) for name, numbers in nodes.items()]
    shells = types.get("triangle", "") == _SHELLS["triangle"] and content.dimension == 2
    for word in (words[name] for name in materials):
        section = f"*{'SHELL' if shells else 'SOLID'} SECTION, ELSET={word}, MATERIAL={word}\n"
        size = "" if content.dimension == 3 else "1.\n"  # a thickness or an area, which there has to be
        parts.append(f"*MATERIAL, NAME={word}\n{section}{size}".encode())
    return b"".join(parts)


def _types(content: Content) -> dict[str, str]:
    """Return what elements are called: those of faces are plane, or shells where the mesh is no plane one."""
    points = np.asarray(content.points)
    plane = content.dimension < 3 and (points.shape[1] == 2 or not np.ptp(points[:, 2]))
    faces = {key: f"CPS{nodes}" for nodes, key in PLANES.items() if nodes < 9} if plane else {}
    return {"line": "T3D2", **_SHELLS, **faces, **{key: f"C3D{nodes}" for nodes, key in SOLIDS.items()}}


def _sets(content: Content) -> tuple[Sets, Sets, Sets]:
    """Return the numbers of elements of each material and of each other set, and those of nodes.

    What vertices are in is a set of nodes.
    """
    materials: Sets = {}
    elements: Sets = {}
    nodes = {name: [content.nodes[rows]] for name, rows in content.point_sets.items()}
    ids = content.elements
    places = {id(run): i for i, run in enumerate(content.cells)}
    named: list[tuple[str, int, Int64]] = []
    for run, number, rows in content.parts() if content.regions is not None else ():
        i, key = places[id(run)], (dimension_of(run.type), number)
        if key[0] == content.dimension and run.type in HELD:
            materials.setdefault(content.title(*key), []).append(ids[i][rows])
        elif key in content.titles:
            named.append((content.titles[key], i, rows))
    named += [(name, i, rows) for name, runs in content.sets.items() for i, rows in enumerate(runs) if len(rows)]
    for name, i, rows in named:
        if content.cells[i].type in HELD:
            elements.setdefault(name, []).append(ids[i][rows])
        elif content.cells[i].type == "vertex":
            nodes.setdefault(name, []).append(content.nodes[content.cells[i].vertices[rows, 0]])
    return materials, elements, nodes


def _words(names: Sequence[str]) -> dict[str, str]:
    """Return names that begin with a letter; Abaqus does not tell small letters from capitals."""
    return words_of(names, r"A-Za-z0-9_-", lower=True, spelled=_begun)


def _begun(name: str) -> str:
    return name if re.match("[A-Za-z]", name) else f"set_{name}"


def _set(keyword: str, word: str, parts: Sequence[Int64]) -> bytes:
    """Return a set: the first and the last of its numbers where it has all between, else lines of numbers."""
    numbers = np.unique(np.concatenate(parts))
    if len(numbers) > _ON_LINE and numbers[-1] - numbers[0] == len(numbers) - 1:
        return f"*{keyword}, {keyword}={word}, GENERATE\n{numbers[0]}, {numbers[-1]}, 1\n".encode()
    whole = len(numbers) // _ON_LINE * _ON_LINE
    rows = [numbers[:whole].reshape(-1, _ON_LINE), numbers[None, whole:]]
    return f"*{keyword}, {keyword}={word}\n".encode() + b"".join(
        integers(one, between=", ") for one in rows if one.size
    )
