"""TOML files by path, or by name where we ship them."""

import tomllib
from pathlib import Path
from typing import Any

from elastune.app.errors import UserError, meant

# Files that people have beside a scene, by their ends and by how they begin.
MESHES = {".msh", ".stl", ".vtk", ".vtu", ".xdmf", ".obj", ".ply", ".off", ".inp", ".unv", ".med", ".mesh", ".bdf"}
DRAWINGS = {".geo", ".step", ".stp", ".iges", ".igs", ".brep", ".geo_unrolled"}
BEGINNINGS = (b"$MeshFormat", b"solid ", b"ply\n", b"ply\r", b"# vtk DataFile")


def names(folder: Path) -> list[str]:
    """Names of the files that a folder ships."""
    return sorted(path.stem for path in folder.glob("*.toml"))


def read(source: str, folder: Path, kind: str) -> tuple[Path, dict[str, Any]]:
    """Reads a file.

    Args:
        source: Its path, or the name of a shipped one.
        folder: Of the shipped ones.
        kind: What it is called in errors, e.g. "scene".

    Returns:
        Its path and its tables.

    Raises:
        UserError: One line, if there is no such file, or it is not TOML.
    """
    path = Path(source)
    if not path.exists() and (folder / f"{source}.toml").is_file():
        path = folder / f"{source}.toml"
    if not path.exists():
        ours = [*names(folder), *(str(path.with_name(file.name)) for file in _beside(path))]
        raise UserError(f"{source}: no {kind} of that name and no such file; {meant(source, ours, 'there are')}")
    if path.is_dir():
        inside = next(iter(sorted(path.glob("*.toml"))), None)
        raise UserError(f"{source}: is a folder; {f'did you mean {inside}?' if inside else f'expected a {kind} file'}")
    try:
        content = path.read_bytes()
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror or error}") from None
    if not content.strip():
        raise UserError(f"{path}: is empty; expected a {kind} in TOML, or the name of a shipped one")
    _refuse_others(path, content)
    try:
        # Windows puts a mark before UTF-8.
        return path, tomllib.loads(content.decode("utf-8-sig"))
    except UnicodeDecodeError:
        raise UserError(f"{path}: is no text in UTF-8; expected a {kind} in TOML") from None
    except tomllib.TOMLDecodeError as error:
        raise UserError(f"{path}: not TOML: {error}") from None


def _beside(path: Path) -> list[Path]:
    """TOML files where one was looked for."""
    return sorted(path.parent.glob("*.toml")) if path.suffix == ".toml" else []


def _refuse_others(path: Path, content: bytes) -> None:
    """Says what a file is that is not TOML and that we know."""
    end = path.suffix.lower()
    if end in DRAWINGS:
        raise UserError(f"{path}: is a drawing: mesh it (gmsh -3 {path.name}) and name the .msh in [mesh] path")
    if end in MESHES or content.startswith(BEGINNINGS):
        raise UserError(f"{path}: is a mesh: name it in [mesh] path")
    if b"\0" in content:
        raise UserError(f"{path}: is a binary file; expected text in TOML")
