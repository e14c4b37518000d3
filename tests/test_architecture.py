"""The house: imports run one way from folder to folder, no folder or file grows too large, each says what it is."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = ("app", "forms", "geometry")
FILES = sorted(path for room in ROOMS for path in (ROOT / room).rglob("*.py"))

# Of each folder of app/, the floors below that it may stand on; forms and geometry carry all of them.
FLOORS = [
    {"errors", "interrupts"},
    {"body"},
    {"solvers"},
    {"path", "results"},
    {"tuning"},
    {"scene"},
    {"run"},
    {"api", "verify", "batch"},
    {"studies", "stress", "bench"},
    {"cli"},
]


def floor(module: str) -> int:
    """Of a module `elastune.app.ROOM...`."""
    (number,) = (k for k, rooms in enumerate(FLOORS) if module.split(".")[2] in rooms)
    return number


def module(path: Path) -> str:
    return ".".join(["elastune", *path.relative_to(ROOT).with_suffix("").parts])


def imports(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return {name for name in found if name.startswith("elastune.")} - {"elastune.__version__"}


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_imports_run_one_way(path: Path) -> None:
    own = module(path)
    room = own.split(".")[1]
    for name in imports(path):
        if room != "app" or name.split(".")[1] != "app":
            assert name.split(".")[1] in {room, *(("forms", "geometry") if room == "app" else ())}, f"{own}: {name}"
        elif name.split(".")[2] != own.split(".")[2]:
            assert floor(name) < floor(own), f"{own}: {name}"


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_file_says_what_it_is(path: Path) -> None:
    assert ast.get_docstring(ast.parse(path.read_text())), "no docstring"


def test_folders_and_files_stay_small() -> None:
    folders = {path.parent for path in FILES}
    crowded = {folder: len(list(folder.glob("[!_]*.py"))) for folder in folders if "app" in folder.parts}
    assert {folder: n for folder, n in crowded.items() if n > 10} == {}
    long = {path.name: n for path in FILES if (n := len(path.read_text().splitlines())) > 250}
    # A registry with its decorator, and the calibration with what it refuses: one idea each.
    assert set(long) <= {"energy.py", "normalize.py"}, long


def test_the_wheel_has_every_folder() -> None:
    import tomllib

    packages = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]
    assert sorted(packages) == packages == sorted({"elastune", *(module(path.parent) for path in FILES)})
