"""Input files of Abaqus and CalculiX: nodes, elements, sets and surfaces of one part."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from elastune.geometry.errors import GeometryError

SOLID = {
    4: "tetra", 10: "tetra10", 8: "hexahedron", 20: "hexahedron20", 27: "hexahedron27",
    6: "wedge", 15: "wedge15", 5: "pyramid", 13: "pyramid13",
}  # fmt: skip
PLANE = {3: "triangle", 6: "triangle6", 4: "quad", 8: "quad8", 9: "quad9"}
LINE = {2: "line", 3: "line3"}
# What an element type looks like; elements that are no bodies, such as springs and masses, are left out.
TYPES = (
    (re.compile(r"[ADF]?C3D(\d+)"), SOLID),
    (re.compile(r"(?:[AD]?C2D|CPEG?|CPS|CG?AX|[AD]CAX|S|DS|STRI|M3D|R3D|SFM3D)(\d)"), PLANE),
    (re.compile(r"(?:T[23]D|R2D|SAX)(\d)"), LINE),
    (re.compile(r"B[23](\d)"), {1: "line", 2: "line3", 3: "line"}),
)
NO_BODY = re.compile(r"MASS|SPRING|DASHPOT|CONN|ROTARYI|GAP|DCOUP|RB")
# Corners of the faces S1, S2, … of a cell.
FACES: dict[str, tuple[tuple[int, ...], ...]] = {
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quad": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetra": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "hexahedron": ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)),
}
FACET = {2: "line", 3: "triangle", 4: "quad"}

Card = tuple[str, dict[str, str], list[list[str]]]


class Part:
    """What the cards of a file say."""

    def __init__(self) -> None:
        """An empty part."""
        self.points: list[list[float]] = []
        self.rows: dict[int, int] = {}
        self.types: dict[int, str] = {}
        self.nodes: dict[int, list[int]] = {}
        self.node_sets: dict[str, list[int]] = {}
        self.element_sets: dict[str, list[int]] = {}
        self.surfaces: dict[str, list[tuple[int, int]]] = {}

    def take(self, path: Path, card: Card) -> None:
        """Add what one card says."""
        keyword, options, lines = card
        if keyword == "NODE":
            for words in lines:
                self.rows[int(words[0])] = len(self.points)
                self.points.append([float(word) for word in (*words[1:4], "0", "0")[:3]])
            self._add(self.node_sets, options.get("NSET"), [int(words[0]) for words in lines])
        elif keyword == "ELEMENT":
            self._elements(path, options, lines)
        elif keyword == "NSET":
            self._add(self.node_sets, options.get("NSET"), _numbers(options, lines, self.node_sets))
        elif keyword == "ELSET":
            self._add(self.element_sets, options.get("ELSET"), _numbers(options, lines, self.element_sets))
        elif keyword == "SURFACE" and options.get("TYPE", "ELEMENT").upper() == "NODE":
            self._add(self.node_sets, options.get("NAME"), _numbers({}, [words[:1] for words in lines], self.node_sets))
        elif keyword == "SURFACE":
            faces = self.surfaces.setdefault(options.get("NAME", ""), [])
            for words in lines:
                elements = _numbers({}, [words[:1]], self.element_sets)
                side = words[1].upper() if len(words) > 1 else ""
                # Without a side, or with one of a shell, the elements are the surface.
                number = int(side[1:]) if re.fullmatch(r"S\d", side) else 0
                faces.extend((element, number) for element in elements)
        elif keyword == "INSTANCE" and lines:
            raise GeometryError(f"{path}: expected one part where it is; got an instance that is moved")

    def _elements(self, path: Path, options: dict[str, str], lines: list[list[str]]) -> None:
        kind = options.get("TYPE", "").upper()
        cell = next((names.get(int(m[1])) for pattern, names in TYPES if (m := pattern.match(kind))), None)
        if cell is None:
            if NO_BODY.match(kind):
                return
            raise GeometryError(f"{path}: expected elements of Abaqus for bodies, such as C3D4 or C3D8; got {kind!r}")
        width = int(
            re.sub(r"\D", "", cell)
            or {"line": 2, "triangle": 3, "quad": 4, "tetra": 4, "wedge": 6, "pyramid": 5, "hexahedron": 8}[cell]
        )
        words = [int(word) for line in lines for word in line if word]
        for at in range(0, len(words), width + 1):
            number, *nodes = words[at : at + width + 1]
            if len(nodes) != width:
                raise GeometryError(f"{path}: element {number}: expected {width} nodes, got {len(nodes)}")
            self.types[number], self.nodes[number] = cell, [self.rows[node] for node in nodes]
        self._add(self.element_sets, options.get("ELSET"), words[:: width + 1])

    @staticmethod
    def _add(sets: dict[str, list[int]], name: str | None, members: list[int]) -> None:
        if name:
            sets.setdefault(name, []).extend(members)


def read_inp(path: Path) -> Any:
    """Read a file as a `meshio.Mesh`.

    Element sets become sets of cells; surfaces, and the facets of the skin that lie in a node set, sets of facets.

    Raises:
        GeometryError: Something in it is not understood.
    """
    import meshio

    part = Part()
    parts = 0
    try:
        for card in _cards(path):
            parts += card[0] in ("PART", "INSTANCE") and card[0] == "PART"
            if parts > 1:
                raise GeometryError(f"{path}: expected one part, got several")
            part.take(path, card)
    except (ValueError, KeyError, IndexError, UnicodeDecodeError, OSError) as error:
        raise GeometryError(f"{path}: expected a complete .inp file; got {type(error).__name__}: {error}") from error
    blocks: list[tuple[str, NDArray[np.int64]]] = []
    places: dict[int, tuple[int, int]] = {}
    for cell in dict.fromkeys(part.types.values()):
        own = [number for number, kind in part.types.items() if kind == cell]
        places |= {number: (len(blocks), k) for k, number in enumerate(own)}
        blocks.append((cell, np.array([part.nodes[number] for number in own], dtype=np.int64)))
    cells = {name: _by_block(places, members, len(blocks)) for name, members in part.element_sets.items()}
    facets = {name: _faces(part, faces) for name, faces in part.surfaces.items()}
    nodes = {name: [part.rows[node] for node in members] for name, members in part.node_sets.items()}
    facets = {**_on_skin(blocks, nodes), **facets}
    for name, found in facets.items():
        for width, corners in found.items():
            blocks.append((FACET[width], corners))
            cells.setdefault(name, [np.empty(0, dtype=np.int64)] * (len(blocks) - 1))
            cells[name] += [np.empty(0, dtype=np.int64)] * (len(blocks) - 1 - len(cells[name]))
            cells[name].append(np.arange(len(corners)))
    for members in cells.values():
        members += [np.empty(0, dtype=np.int64)] * (len(blocks) - len(members))
    return meshio.Mesh(part.points, blocks, cell_sets=cells, point_sets=nodes)


def _cards(path: Path) -> Iterator[Card]:
    """Keyword, options and data lines, of the file and those it includes."""
    card: Card | None = None
    for line in path.read_text(encoding="latin-1").splitlines():
        text = line.strip()
        if text.startswith("**") or not text:
            continue
        if text.startswith("*"):
            if card:
                yield card
            keyword, *options = (word.strip() for word in text[1:].split(","))
            pairs = (option.partition("=") for option in options)
            card = (keyword.upper(), {key.strip().upper(): value.strip().strip('"') for key, _, value in pairs}, [])
            if card[0] == "INCLUDE":
                yield from _cards(path.parent / card[1]["INPUT"])
        elif card:
            card[2].append([word.strip() for word in text.rstrip(",").split(",")])
    if card:
        yield card


def _numbers(options: dict[str, str], lines: list[list[str]], sets: dict[str, list[int]]) -> list[int]:
    """Members of a set: numbers, other sets, or ranges."""
    if "GENERATE" in options:
        ranges = [[int(word) for word in words] for words in lines]
        return [k for start, stop, *step in ranges for k in range(start, stop + 1, *step)]
    words = [word for line in lines for word in line if word]
    return [k for word in words for k in ([int(word)] if word.isdigit() else sets[word])]


def _by_block(places: dict[int, tuple[int, int]], members: list[int], count: int) -> list[NDArray[np.int64]]:
    found: list[list[int]] = [[] for _ in range(count)]
    for member in members:
        if member in places:
            block, k = places[member]
            found[block].append(k)
    return [np.array(each, dtype=np.int64) for each in found]


def _faces(part: Part, faces: list[tuple[int, int]]) -> dict[int, NDArray[np.int64]]:
    """Corners of the facets of a surface, by their count."""
    found: dict[int, list[list[int]]] = {}
    for element, side in faces:
        base = re.sub(r"\d", "", part.types[element])
        corners = range(len(FACES[base])) if side == 0 else FACES[base][side - 1]
        nodes = [part.nodes[element][corner] for corner in corners]
        found.setdefault(len(nodes), []).append(nodes)
    return {width: np.array(each, dtype=np.int64) for width, each in found.items()}


def _on_skin(
    blocks: list[tuple[str, NDArray[np.int64]]], sets: dict[str, list[int]]
) -> dict[str, dict[int, NDArray[np.int64]]]:
    """Facets with one cell only whose corners all lie in a node set, by set and count of corners."""
    solid = any(kind.startswith(("tetra", "hexa")) for kind, _ in blocks)
    bases = [re.sub(r"\d", "", kind) for kind, _ in blocks]
    wanted = ("tetra", "hexahedron") if solid else ("triangle", "quad")
    facets: dict[int, list[NDArray[np.int64]]] = {}
    for base, (_, nodes) in zip(bases, blocks, strict=True):
        if base in wanted:
            for corners in FACES[base]:
                facets.setdefault(len(corners), []).append(nodes[:, corners])
    found: dict[str, dict[int, NDArray[np.int64]]] = {name: {} for name in sets}
    for width, each in facets.items():
        corners = np.concatenate(each)
        _, first, counts = np.unique(np.sort(corners, axis=1), axis=0, return_index=True, return_counts=True)
        outer = corners[first[counts == 1]]
        for name, members in sets.items():
            inside = np.isin(outer, members).all(axis=1)
            if inside.any():
                found[name][width] = outer[inside]
    return found
