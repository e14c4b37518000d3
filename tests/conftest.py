"""What tests of several rooms use."""

import json
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]


def own_lines(errors: str) -> list[str]:
    """What a command says on standard error; what its launcher adds stands between dashes or behind [host:process]."""
    own, launcher = [], False
    for line in errors.splitlines():
        dashes = line.startswith("-----")
        launcher ^= dashes
        if not (launcher or dashes or re.match(r"\[\S+:\d+\] ", line)):
            own.append(line)
    return own


@pytest.fixture
def elastune(tmp_path: Path) -> Callable[..., subprocess.CompletedProcess[str]]:
    """The command line as a person runs it, in an empty folder, on any number of ranks."""

    def call(*words: object, ranks: int = 1) -> subprocess.CompletedProcess[str]:
        launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
        command = [*launcher, sys.executable, "-m", "elastune", *map(str, words)]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=900, check=False)

    return call


@pytest.fixture
def solved(elastune: Callable[..., subprocess.CompletedProcess[str]], tmp_path: Path) -> Callable[..., dict[str, Any]]:
    """Runs a scene without its picture and reads its summary."""

    def call(scene: object, *overrides: str, ranks: int = 1) -> dict[str, Any]:
        folder = tmp_path / f"run-{len(list(tmp_path.iterdir()))}"
        settings = [word for override in ("output.picture=false", *overrides) for word in ("--set", override)]
        done = elastune("run", scene, *settings, "--out", folder, ranks=ranks)
        assert done.returncode in (0, 3), done.stderr
        assert done.stderr == ""
        return json.loads((folder / "summary.json").read_text())

    return call
