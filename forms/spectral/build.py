"""Compiles kernels to shared libraries, kept beside FFCx's cache."""

import ctypes
import hashlib
import os
import platform
import shlex
import subprocess
import tempfile
from collections.abc import Callable
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from dolfinx import jit

KERNELS = Path(__file__).parent / "kernel"
# No -ffast-math: NaN and infinity must stay what they are. The two options left change no value.
FLAGS = ("-std=gnu17", "-O3", "-march=native", "-fno-math-errno", "-fno-trapping-math", "-shared", "-fPIC")


class SpectralError(ValueError):
    """A form that the kernel cannot be made for: one line with what was expected and what came."""


def load(source: str, key: str, generate: Callable[[], str], comm: Any = None) -> ctypes.CDLL:
    """The library of a kernel file with generated code, compiled unless a cache holds it.

    Processes may ask at the same time: each compiles in a folder of its own and renames the result into place. The
    ranks of a communicator wait for the first of them.

    Args:
        source: Name of the file in kernel/.
        key: All that the generated code depends on.
        generate: Makes `generated.h`; called only when nothing is cached.
        comm: MPI communicator; collective if given.

    Raises:
        SpectralError: If the compiler fails or there is none; on every rank.
    """
    path = _cache_folder() / f"libelastune_{Path(source).stem}_{_digest(source, key)}.so"
    if comm is None or comm.size == 1:
        if not path.exists():
            _compile(source, generate(), path)
        return ctypes.CDLL(str(path))
    # Ranks that wait for rank 0 would wait for ever, whatever goes wrong there.
    error, cause = None, None
    if comm.rank == 0 and not path.exists():
        try:
            _compile(source, generate(), path)
        except Exception as failure:
            error, cause = " ".join(str(failure).split()) or type(failure).__name__, failure
    if (error := comm.bcast(error)) is not None:
        raise SpectralError(error) from cause
    if not path.exists():
        # Another machine's rank, with a cache of its own.
        _compile(source, generate(), path)
    return ctypes.CDLL(str(path))


def address(library: ctypes.CDLL, name: str) -> int:
    """Where a function of a library is."""
    return int(ctypes.cast(getattr(library, name), ctypes.c_void_p).value or 0)


def _cache_folder() -> Path:
    return Path(jit.get_options()["cache_dir"])


def _digest(source: str, key: str) -> str:
    content = hashlib.sha256()
    for part in (source, key, _environment(), *FLAGS):
        content.update(part.encode())
        content.update(b"\0")
    return content.hexdigest()[:24]


@cache
def _environment() -> str:
    """Kernel files, compiler, processor and the versions of what generates code."""
    files = [path.read_text() for path in sorted(KERNELS.glob("*.[ch]"))]
    versions = [version(name) for name in ("fenics-ufl", "fenics-ffcx", "fenics-basix")]
    return "\0".join([*files, *versions, *_compiler(), _processor()])


def _compiler() -> list[str]:
    return shlex.split(os.environ.get("CC", "gcc"))


@cache
def _processor() -> str:
    """What -march=native depends on."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    return next((line for line in lines if line.startswith(("flags", "Features"))), platform.machine())


def _compile(source: str, generated: str, path: Path) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _compile_aside(source, generated, path)
    except OSError as failure:
        raise SpectralError(f"{path.parent}: kernels cannot be written: {failure.strerror}") from None


def _compile_aside(source: str, generated: str, path: Path) -> None:
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".elastune-") as folder:
        Path(folder, "generated.h").write_text(generated)
        output = Path(folder, "kernel.so")
        command = [*_compiler(), *FLAGS, f"-I{folder}", f"-I{KERNELS}", str(KERNELS / source), "-o", str(output), "-lm"]
        try:
            result = subprocess.run(command, capture_output=True, text=True, check=False)
        except OSError as failure:
            raise SpectralError(f"{command[0]}: expected a C compiler; set CC; {failure.strerror}") from None
        if result.returncode != 0:
            lines = result.stderr.strip().splitlines() or [f"exit status {result.returncode}"]
            message = next((line for line in lines if "error" in line), lines[0])
            raise SpectralError(f"{command[0]}: could not compile {source}: {message}")
        os.replace(output, path)
