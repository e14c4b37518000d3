"""Folders that grow by themselves: compiled kernels, and the Debian roots of ./run."""

import hashlib
import os
import platform
import re
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from pathlib import Path

# As `run` names roots.
RELEASES = ("trixie", "sid")
ROOT = re.compile(r"[a-z]+-[0-9a-f]{12}")
KERNELS = ("libffcx_*", "libelastune_*", ".elastune-*")


def home() -> Path:
    """Where `./run` keeps its roots."""
    return Path(os.environ.get("ELASTUNE_CACHE") or _xdg() / "elastune")


def kernels() -> Path:
    """Where FEniCSx keeps what it compiles, and we ours."""
    try:
        from dolfinx import jit
    except ImportError:
        return _xdg() / "fenics"
    return Path(jit.get_options()["cache_dir"])


def compiled() -> list[Path]:
    """Files of compiled kernels."""
    return sorted(path for pattern in KERNELS for path in kernels().glob(pattern))


def roots() -> dict[Path, bool]:
    """Roots of `./run`, and whether a checkout that it was called in uses each."""
    used = set(_used())
    found = sorted(path for path in home().glob("*-*") if path.is_dir() and ROOT.fullmatch(path.name))
    return {path: path.name in used for path in found}


def size(paths: Sequence[Path]) -> int:
    """Bytes on the disk of files and folders."""
    files = sum(path.stat().st_size for path in paths if path.is_file())
    folders = [str(path) for path in paths if path.is_dir()]
    # Of hundreds of thousands of files: Python would take seconds.
    said = subprocess.run(["du", "-sk", *folders], capture_output=True, text=True).stdout if folders else ""
    return files + sum(1024 * int(line.split()[0]) for line in said.splitlines())


def clean(pretend: bool = False) -> Iterator[tuple[str, int]]:
    """Removes compiled kernels, and roots that no checkout uses any more.

    Args:
        pretend: Whether to remove nothing.

    Yields:
        What is removed, and its bytes.
    """
    old = [path for path, used in roots().items() if not used]
    for what, paths in ((f"kernels in {kernels()}", compiled()), *((f"root {path}", [path]) for path in old)):
        if paths:
            yield what, size(paths)
        for path in () if pretend else paths:
            if path.is_dir():
                shutil.rmtree(path, ignore_errors=True)
                for end in (".lock", ".log"):
                    path.with_name(path.name + end).unlink(missing_ok=True)
            else:
                path.unlink(missing_ok=True)
    for link in home().glob("path/*/elastune"):
        if not pretend and not link.exists():
            shutil.rmtree(link.parent, ignore_errors=True)


def _xdg() -> Path:
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")


def _used() -> Iterator[str]:
    """Names of the roots of all checkouts: `run` makes them of the release, the packages and the machine."""
    for checkout in home().glob("path/*/elastune"):
        try:
            lines = (checkout / "packages.txt").read_text().splitlines()
        except OSError:
            continue
        packages = ",".join(word for line in lines for word in line.partition("#")[0].split())
        for release in RELEASES:
            key = hashlib.sha256(f"{release} {packages} {platform.machine()}".encode()).hexdigest()[:12]
            yield f"{release}-{key}"
