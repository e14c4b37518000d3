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

NODES = {cell: count for table in (SOLID, PLANE, LINE) for count, cell in table.items()}

Index = NDArray[np.int64]
Card = tuple[str, dict[str, str], list[list[str]]]


class Part:
    """What the cards of a file say.

    Attributes:
        points: Places of the nodes.
        rows: Of each node by number, its place in `points`.
        types: meshio's cell type of each element by number.
        nodes: Of each element by number, its nodes' places.
        node_sets: Numbers of nodes, by name.
        element_sets: Numbers of elements, by name.
        surfaces: Elements and sides, by name; side 0 is the element, of a shell.
    """

    def __init__(self, path: Path) -> None:
        """An empty part of a file."""
        self._path, self._ended, self._spelled = path, False, dict[str, str]()
        self.points: list[list[float]] = []
        self.rows: dict[int, int] = {}
        self.types: dict[int, str] = {}
        self.nodes: dict[int, list[int]] = {}
        self.node_sets: dict[str, list[int]] = {}
        self.element_sets: dict[str, list[int]] = {}
        self.surfaces: dict[str, list[tuple[int, int]]] = {}

    def take(self, card: Card) -> None:
        """Add what one card says."""
        keyword, options, lines = card
        # Behind the part, an assembly has nodes and sets of its own, unless they are said to be of the part.
        own = not self._ended or "INSTANCE" in options
        if keyword == "PART" and self._ended:
            raise GeometryError(f"{self._path}: expected one part, got several")
        if keyword == "INSTANCE" and lines:
            raise GeometryError(f"{self._path}: expected one part where it is, got an instance that is moved")
        self._ended |= keyword == "END PART"
        if keyword == "NODE" and own:
            for words in lines:
                if self.rows.setdefault(int(words[0]), len(self.points)) != len(self.points):
                    raise GeometryError(f"{self._path}: expected one node {words[0]}, got two")
                self.points.append([float(word) for word in (*words[1:4], "0", "0")[:3]])
            self._add(self.node_sets, options.get("NSET"), [int(words[0]) for words in lines])
        elif keyword == "ELEMENT" and own:
            self._elements(options, lines)
        elif keyword == "NSET" and own:
            self._add(self.node_sets, options["NSET"], self._numbers(options, lines, self.node_sets))
        elif keyword == "ELSET" and own:
            self._add(self.element_sets, options["ELSET"], self._numbers(options, lines, self.element_sets))
        elif keyword == "SURFACE" and options.get("TYPE", "ELEMENT").upper() == "NODE":
            first = [words[:1] for words in lines]
            self._add(self.node_sets, options["NAME"], self._numbers({}, first, self.node_sets))
        elif keyword == "SURFACE" and options.get("TYPE", "ELEMENT").upper() == "ELEMENT":
            faces = self.surfaces.setdefault(options["NAME"], [])
            for words in lines:
                side = words[1].upper() if len(words) > 1 else ""
                number = int(side[1:]) if re.fullmatch(r"S\d", side) else 0
                faces += [(element, number) for element in self._numbers({}, [words[:1]], self.element_sets)]

    def _elements(self, options: dict[str, str], lines: list[list[str]]) -> None:
        kind = options.get("TYPE", "").upper()
        cell = next((names.get(int(m[1])) for pattern, names in TYPES if (m := pattern.match(kind))), None)
        if cell is None:
            if NO_BODY.match(kind):
                return
            expected = "elements of bodies, such as C3D4 or C3D8"
            raise GeometryError(f"{self._path}: expected {expected}; got {kind!r}")
        words, width = [int(word) for line in lines for word in line if word], NODES[cell]
        for at in range(0, len(words), width + 1):
            number, *nodes = words[at : at + width + 1]
            if len(nodes) != width:
                raise GeometryError(f"{self._path}: element {number}: expected {width} nodes, got {len(nodes)}")
            self.types[number], self.nodes[number] = cell, [self.rows[node] for node in nodes]
        self._add(self.element_sets, options.get("ELSET"), words[:: width + 1])

    def _add(self, sets: dict[str, list[int]], name: str | None, members: list[int]) -> None:
        if name:
            sets.setdefault(self._spelling(name), []).extend(members)

    def _spelling(self, name: str) -> str:
        """A name as it was written first: case does not matter, nor does the instance before it."""
        name = name.rpartition(".")[2]
        return self._spelled.setdefault(name.upper(), name)

    def _numbers(self, options: dict[str, str], lines: list[list[str]], sets: dict[str, list[int]]) -> list[int]:
        """Members of a set: numbers, other sets, or ranges."""
        if "GENERATE" in options:
            ranges = [[int(word) for word in words] for words in lines]
            return [k for start, stop, *step in ranges for k in range(start, stop + 1, *step)]
        words = [word for line in lines for word in line if word]
        return [k for word in words for k in ([int(word)] if word.isdigit() else sets[self._spelling(word)])]


def read_inp(path: Path) -> Any:
    """Read a file as a `meshio.Mesh`.

    Element sets become sets of cells; surfaces, and the facets of the skin that lie in a node set, sets of facets.

    Raises:
        GeometryError: Something in it is not understood.
    """
    import meshio

    part = Part(path)
    try:
        for card in _cards(path):
            part.take(card)
    except (ValueError, KeyError, IndexError, OSError) as error:
        raise GeometryError(f"{path}: expected a complete .inp file; got {type(error).__name__}: {error}") from error
    nodes = {name: [part.rows[node] for node in members] for name, members in part.node_sets.items()}
    blocks: list[tuple[str, Index]] = []
    places: dict[int, tuple[int, int]] = {}
    for cell in dict.fromkeys(part.types.values()):
        own = [number for number, kind in part.types.items() if kind == cell]
        places |= {number: (len(blocks), k) for k, number in enumerate(own)}
        blocks.append((cell, np.array([part.nodes[number] for number in own], dtype=np.int64)))
    # Places in each block, by set and block.
    sets: dict[str, dict[int, Any]] = {name: {} for name in part.element_sets}
    for name, members in part.element_sets.items():
        for block, k in (places[member] for member in members if member in places):
            sets[name].setdefault(block, []).append(k)
    surfaces = _on_skin(blocks, nodes) | {name: _faces(path, part, faces) for name, faces in part.surfaces.items()}
    for name, found in surfaces.items():
        for width, corners in found.items():
            sets.setdefault(name, {})[len(blocks)] = range(len(corners))
            blocks.append((FACET[width], corners))
    cell_sets = {name: [list(own.get(k, [])) for k in range(len(blocks))] for name, own in sets.items()}
    return meshio.Mesh(part.points, blocks, cell_sets=cell_sets, point_sets=nodes)


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


def _faces(path: Path, part: Part, faces: list[tuple[int, int]]) -> dict[int, Index]:
    """Corners of the facets of a surface, by their count."""
    found: dict[int, list[list[int]]] = {}
    for element, side in faces:
        base = re.sub(r"\d", "", part.types[element])
        if side == 0 and base not in ("triangle", "quad"):
            raise GeometryError(f"{path}: expected a surface by sides S1, S2, …; got elements {base} without")
        corners = range(len(FACES[base])) if side == 0 else FACES[base][side - 1]
        nodes = [part.nodes[element][corner] for corner in corners]
        found.setdefault(len(nodes), []).append(nodes)
    return {width: np.array(each, dtype=np.int64) for width, each in found.items()}


def _on_skin(blocks: list[tuple[str, Index]], sets: dict[str, list[int]]) -> dict[str, dict[int, Index]]:
    """Facets with one cell only whose corners all lie in a node set, by set and count of corners."""
    solid = any(kind.startswith(("tetra", "hexa")) for kind, _ in blocks)
    bases = [re.sub(r"\d", "", kind) for kind, _ in blocks]
    wanted = ("tetra", "hexahedron") if solid else ("triangle", "quad")
    facets: dict[int, list[Any]] = {}
    for base, (_, nodes) in zip(bases, blocks, strict=True):
        if base in wanted:
            for corners in FACES[base]:
                facets.setdefault(len(corners), []).append(nodes[:, corners])
    found: dict[str, dict[int, Index]] = {name: {} for name in sets}
    for width, each in facets.items():
        every = np.concatenate(each)
        _, first, counts = np.unique(np.sort(every, axis=1), axis=0, return_index=True, return_counts=True)
        outer: Index = every[first[counts == 1]]
        for name, members in sets.items():
            inside = np.isin(outer, members).all(axis=1)
            if inside.any():
                found[name][width] = outer[inside]
    return found
