"""Imports run one way: cli -> run, batch -> scene, solve, output -> forms, geometry."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = ("app", "forms", "geometry")
FILES = sorted(path for room in ROOMS for path in (ROOT / room).rglob("*.py"))

# Within app, from the ground up: a file imports only files of lower rank.
RANKS = [
    {"errors", "results"},
    {"arguments", "scene", "toml", "catalogue", "xdmf", "fields", "plots"},
    {"check", "constraints", "output"},
    {"load", "problem"},
    {"study", "orders", "bench"},
    {"merit", "tangent", "measures", "predict", "start", "diagnose", "independent", "exact", "cases"},
    {"newton", "records", "blocks", "escape"},
    {"solve", "comparison"},
    {"saddle", "recover"},
    {"stepping"},
    {"run", "stress", "case", "figures"},
    {"progress", "matrix", "converge"},
    {"cli"},
    {"__main__"},
]


def _imports(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            found.add(node.module or "")
    return {name for name in found if name.split(".")[0] in ROOMS}


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_rooms_below_know_nothing_above(path: Path) -> None:
    room = path.relative_to(ROOT).parts[0]
    allowed = {"app": set(ROOMS), "forms": {"forms"}, "geometry": {"geometry"}}[room]
    assert {name.split(".")[0] for name in _imports(path)} <= allowed


def _rank(name: str) -> int:
    ranks = [rank for rank, names in enumerate(RANKS) if name in names]
    assert len(ranks) == 1, f"app/{name}.py has no place in the order of imports"
    return ranks[0]


@pytest.mark.parametrize("path", [p for p in FILES if p.parent.name == "app"], ids=lambda path: path.name)
def test_app_imports_run_one_way(path: Path) -> None:
    if path.stem == "__init__":
        return
    for name in _imports(path):
        if name.startswith("app."):
            assert _rank(name.split(".")[1]) < _rank(path.stem), f"{path.name} imports {name}"


def test_only_solve_touches_snes() -> None:
    for path in FILES:
        text = path.read_text()
        if path.name != "solve.py":
            assert "PETSc.SNES" not in text, path


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_file_says_what_it_is(path: Path) -> None:
    assert ast.get_docstring(ast.parse(path.read_text())), "no docstring"
