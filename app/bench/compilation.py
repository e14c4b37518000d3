"""Seconds until a spectral tangent can be assembled, with an empty cache and with a warm one.

Run as a module, `python -m elastune.app.bench.compilation`, it is the process that is measured: it reads names of
elements and materials as JSON and answers with seconds, compiling into the cache that the environment names.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass

from elastune.app.errors import UserError


@dataclass(frozen=True)
class Compilation:
    """Seconds of one material on one element."""

    element: str
    material: str
    empty: float
    warm: float


def compilations(elements: Sequence[str], materials: Sequence[str]) -> list[Compilation]:
    """Compiles everything in a new process with an empty cache, and does so again in another.

    Raises:
        UserError: If that fails.
    """
    with tempfile.TemporaryDirectory() as cache:
        empty, warm = (_measured(cache, elements, materials) for _ in range(2))
    pairs = [(element, material) for element in elements for material in materials]
    return [Compilation(*pair, *seconds) for pair, *seconds in zip(pairs, empty, warm, strict=True)]


def _measured(cache: str, elements: Sequence[str], materials: Sequence[str]) -> list[float]:
    done = subprocess.run(
        [sys.executable, "-m", "elastune.app.bench.compilation"],
        input=json.dumps([list(elements), list(materials)]),
        env=os.environ | {"XDG_CACHE_HOME": cache},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        raise UserError(f"bench kernels: compilation: {(done.stderr.strip().splitlines() or ['no message'])[-1]}")
    return [float(seconds) for seconds in json.loads(done.stdout)]


def _answer() -> None:
    from elastune.app.bench.kernels import ELEMENTS, Cells, deformed
    from elastune.forms.materials import make
    from elastune.forms.spectral import SpectralForms

    elements, materials = json.load(sys.stdin)
    seconds = []
    for element in elements:
        u = deformed(Cells(ELEMENTS[element].cell, ELEMENTS[element].order, 1))
        for material in materials:
            energy = make(material)
            began = time.perf_counter()
            _ = SpectralForms(energy, u).tangent
            seconds.append(time.perf_counter() - began)
    print(json.dumps(seconds))


if __name__ == "__main__":
    _answer()
