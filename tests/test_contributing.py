"""The example of CONTRIBUTING, applied to a copy of the code and run."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]

SCENE = """
mesh = { cells = 1 }
solve = { element = "Q1", steps = 1, tolerance = 1e-11 }
material = { name = "neo-hookean", E = 1e6, nu = 0.0 }
[boundary]
left = { roller = ["x"] }
front = { roller = ["y"] }
bottom = { spring = { stiffness = 1.0 }, cushion = 2.0 }
top = { pull = [0.0, 0.0, 0.5] }
"""


def hunks(diff: str) -> list[tuple[str, list[str], list[str]]]:
    """File, lines that are there, and lines that take their place."""
    found: list[tuple[str, list[str], list[str]]] = []
    file = ""
    for line in diff.splitlines():
        if line.startswith("+++ b/"):
            file = line[6:]
        elif line.startswith("@@"):
            found.append((file, [], []))
        elif not line.startswith("---"):
            if not line.startswith("+"):
                found[-1][1].append(line[1:])
            if not line.startswith("-"):
                found[-1][2].append(line[1:])
    return found


def test_a_cushion_is_thirty_lines(tmp_path: Path) -> None:
    """A stiff block on a spring of stiffness k and a cushion of c: pulled by T, it rises by u, k u + c u³ = T."""
    (diff,) = re.findall(r"```diff\n(.*?)```", (ROOT / "CONTRIBUTING.md").read_text(), re.DOTALL)
    assert sum(line.startswith("+") and not line.startswith("+++") for line in diff.splitlines()) <= 30
    copy = tmp_path / "elastune"
    for name in ("app", "forms", "geometry"):
        shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("__init__.py", "__main__.py"):
        shutil.copy(ROOT / name, copy / name)
    for file, before, after in hunks(diff):
        text = (copy / file).read_text()
        old, new = "\n".join(before) + "\n", "\n".join(after) + "\n"
        assert text.count(old.rstrip("\n")) == 1, (file, old)
        (copy / file).write_text(text.replace(old.rstrip("\n"), new.rstrip("\n")))
    (tmp_path / "cushion.toml").write_text(SCENE)
    words = ["run", "cushion.toml", "--out", "out", "--set", "output.picture=false"]
    done = subprocess.run(
        [sys.executable, "-P", "-m", "elastune", *words],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    (step,) = json.loads((tmp_path / "out" / "summary.json").read_text())["steps"]
    u = step["max_displacement"]
    assert abs(1.0 * u + 2.0 * u**3 - 0.5) < 1e-5
