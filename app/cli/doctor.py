"""What `elastune doctor` finds: what is installed, what is missing or slow, and how to mend it."""

import ctypes
import os
import platform
import re
import shutil
import time
from collections.abc import Callable, Iterator
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from elastune import __version__
from elastune.app.cli import caches, needs
from elastune.app.cli.endings import ranks
from elastune.app.errors import UserError

# Of three arrays together, larger than any cache of a processor.
TRIAD = 3 * 2**26

# Compiled kernels beyond which it is worth to say that they can go.
MANY = 2e9


class Examination:
    """Findings, and advice where something is missing or slow.

    Attributes:
        findings: What was found, by name.
        advice: What to mend, and how.
        usable: Whether scenes can be run.
    """

    def __init__(self) -> None:
        """Looks at everything; collective over the ranks of MPI's world, if there is one."""
        self.findings = {"elastune": f"{__version__}, Python {platform.python_version()}"}
        self.advice: list[str] = []
        self.usable = True
        try:
            needs.usable()
        except UserError as error:
            self.usable = False
            self.advice.append(str(error))
        self._fenicsx()
        self._machine()
        self._tools()
        self._caches()

    def lines(self) -> Iterator[str]:
        """For the screen."""
        yield from (f"{name:<10} {what}" for name, what in self.findings.items())
        yield from (f"to mend: {advice}" for advice in self.advice)
        if not self.advice:
            yield "all is well"

    # ------------------------------------------------------------------ parts

    def _fenicsx(self) -> None:
        if not self.usable:
            found = [f"{name} {_version(f'fenics-{name}')}" for name in ("dolfinx", "ufl") if find_spec(name)]
            self.findings["FEniCSx"] = ", ".join(found) or "none"
            return
        import dolfinx
        import slepc4py
        from mpi4py import MPI
        from petsc4py import PETSc

        from elastune.app.results.machine import versions

        self.findings["dolfinx"] = dolfinx.__version__
        solvers = {name: PETSc.Sys.hasExternalPackage(name) for name in ("mumps", "hypre")}  # type: ignore[attr-defined]
        having = ", ".join(f"{'with' if has else 'without'} {name.upper()}" for name, has in solvers.items())
        self.findings["PETSc"] = f"{versions()['petsc']}, real, {having}"
        self.findings["SLEPc"] = slepc4py.__version__
        self.findings["MPI"] = f"{_first(MPI.Get_library_version())}; {MPI.COMM_WORLD.size} here"
        if not solvers["mumps"]:
            self.usable = False
            self.advice.append("PETSc has no MUMPS, which factorises: take the PETSc of conda-forge, Debian or ./run")
        self._blas()

    def _blas(self) -> None:
        """The library that PETSc and MUMPS multiply with: Debian's reference one takes five times as long."""
        libraries = _loaded(r"lib(openblas|mkl_rt|blis|flexiblas|blas|cblas|Accelerate)\b[^/]*")
        if not libraries:
            return
        quick = [path for path in libraries if re.search("openblas|mkl|blis|Accelerate", str(path))]
        path = (quick or libraries)[0]
        count = _threads(path)
        self.findings["BLAS"] = f"{path}, threads of a rank: {count or 'unknown'}"
        if not quick:
            self.advice.append(f"{path.name} is slow: install OpenBLAS, in Debian libopenblas0-pthread")
        if count and count > 1:
            self.advice.append("threads of BLAS compete with ranks: export OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1")

    def _machine(self) -> None:
        self.findings["cores"] = f"{_cores()}, {_memory()} of memory"
        if ranks() > _cores():
            self.advice.append(f"{ranks()} ranks share {_cores()} cores: mpirun -n {_cores()} is faster")
        if find_spec("numpy"):
            self.findings["bandwidth"] = f"{_bandwidth() / 1e9:.1f} GB/s of memory, all ranks together"

    def _tools(self) -> None:
        compiler = (os.environ.get("CC") or "gcc").split()[0]
        found = shutil.which(compiler)
        self.findings["compiler"] = found or "none"
        if found is None:
            self.usable = False
            self.advice.append(f"no C compiler {compiler}, which kernels need: install gcc, or set CC")
        server = "with Xvfb" if shutil.which("Xvfb") else "without Xvfb"
        self.findings["pictures"] = f"pyvista {_version('pyvista')} {server}; gmsh {_version('gmsh')}"
        if find_spec("pyvista") is None:
            self.advice.append("no pyvista, which draws deformed.png: pip install pyvista")
        elif "DISPLAY" not in os.environ and shutil.which("Xvfb") is None:
            self.advice.append("no display and no Xvfb: deformed.png may stay out; install xvfb")

    def _caches(self) -> None:
        kernels = caches.compiled()
        total = caches.size(kernels)
        self.findings["kernels"] = f"{caches.kernels()}, {total / 1e6:.0f} MB"
        if total > MANY:
            self.advice.append(f"compiled kernels take {total / 1e9:.1f} GB: elastune clean")
        if locked := [path for path in kernels if path.suffix == ".c" and not Path(f"{path}.cached").exists()]:
            self.advice.append(f"{len(locked)} kernels whose compilation was killed make runs wait: elastune clean")
        roots = caches.roots()
        if roots:
            self.findings["roots"] = f"{caches.home()}, {caches.size(list(roots)) / 1e9:.1f} GB in {len(roots)}"
        if old := [path.name for path, used in roots.items() if not used]:
            self.advice.append(f"no checkout uses {', '.join(old)}: elastune clean")


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "missing"


def _first(text: str) -> str:
    """Of a library's name and release, without what it was built with."""
    return text.strip("\0 \n").partition("\n")[0].partition(",")[0]


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _memory() -> str:
    return f"{os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES') / 1e9:.0f} GB"


def _loaded(pattern: str) -> list[Path]:
    """Libraries of this process by name; none where the system does not tell."""
    try:
        lines = Path("/proc/self/maps").read_text().splitlines()
    except OSError:
        return []
    paths = {Path(line.split(maxsplit=5)[5]) for line in lines if line.count("/")}
    return sorted(path for path in paths if re.match(pattern, path.name))


def _threads(library: Path) -> int | None:
    """How many threads a BLAS works with, if it tells."""
    opened = ctypes.CDLL(str(library))
    for name in ("openblas_get_num_threads", "MKL_Get_Max_Threads", "bli_thread_get_num_threads"):
        ask: Callable[[], Any] | None = getattr(opened, name, None)
        if ask is not None:
            return int(ask())
    return None


def _bandwidth() -> float:
    """Bytes a second of a = b + s c, the STREAM triad, by all ranks at once."""
    import numpy as np

    comm = None
    if ranks() > 1:
        from mpi4py import MPI

        comm = MPI.COMM_WORLD
    a, b, c = (np.ones(TRIAD // 3 // 8) for _ in range(3))
    best = 0.0
    for _ in range(5):
        if comm is not None:
            comm.Barrier()
        began = time.perf_counter()
        np.multiply(c, 3.0, out=a)
        np.add(a, b, out=a)
        # Three are read and two written.
        best = max(best, 5 * a.nbytes / (time.perf_counter() - began))
    return best if comm is None else float(comm.allreduce(best))
