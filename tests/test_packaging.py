"""What is installed: the package and nothing beside it, from any kind of build, and from a clone of any name."""

import os
import resource
import shutil
import subprocess
import sys
import tarfile
import zipfile
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = ("app", "forms", "geometry")
PACKAGE = ("__init__.py", "__main__.py", "py.typed")
JUNK = {"__pycache__", ".pytest_cache", ".mypy_cache", ".ruff_cache", ".hypothesis", "elastune.egg-info"}

# As outside of the checkout, which `./run` puts on the path.
OUTSIDE = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "MYPYPATH")}


def call(*words: object, cwd: Path, env: dict[str, str] | None = None) -> str:
    command = list(map(str, words))
    done = subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def copied(folder: Path) -> Path:
    """A clean copy of the checkout, without results."""

    def ignored(where: str, names: list[str]) -> set[str]:
        return JUNK | ({".git", "build", "dist", "results"} if Path(where) == ROOT else set())

    return Path(shutil.copytree(ROOT, folder, ignore=ignored))


def built(kind: str, source: Path, folder: Path) -> Path:
    """A wheel, editable or not, or an sdist, by setuptools alone as pip calls it."""
    # Not imported here: it puts a distutils of its own in the place of Python's.
    if find_spec("setuptools") is None or int(version("setuptools").partition(".")[0]) < 77:
        pytest.skip("setuptools 77 or newer builds the package")
    script = f"from setuptools import build_meta as b; print(b.build_{kind}({str(folder)!r}))"
    return folder / call(sys.executable, "-c", script, cwd=source, env=OUTSIDE).splitlines()[-1]


def contents(wheel: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(wheel) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def environment(folder: Path) -> tuple[Path, Path]:
    """Python and site-packages of a virtual environment with nothing in it."""
    # In Debian pip is a package of its own, and not needed to unpack a wheel.
    call(sys.executable, "-m", "venv", "--without-pip", folder, cwd=folder.parent)
    python = folder / "bin/python"
    where = call(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", cwd=folder, env=OUTSIDE)
    return python, Path(where.strip())


@pytest.fixture(scope="module")
def clone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return copied(tmp_path_factory.mktemp("clones") / "my-clone")


@pytest.fixture(scope="module")
def wheel(clone: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built("wheel", clone, tmp_path_factory.mktemp("wheel"))


# ---------------------------------------------------------------- what is in it
def test_the_wheel_holds_the_package_and_nothing_beside_it(wheel: Path) -> None:
    files = [path for room in ROOMS for path in (ROOT / room).rglob("*") if path.is_file()]
    expected = {f"elastune/{path.relative_to(ROOT)}" for path in files if "__pycache__" not in path.parts}
    expected |= {f"elastune/{name}" for name in PACKAGE}
    found = contents(wheel)
    assert {name for name in found if not name.partition("/")[0].endswith(".dist-info")} == expected
    assert {Path(name).suffix for name in expected} == {".py", ".typed", ".toml", ".msh", ".c", ".h"}
    (points,) = (text for name, text in found.items() if name.endswith("/entry_points.txt"))
    assert points.decode() == "[console_scripts]\nelastune = elastune.app.cli.main:main\n"


def test_an_sdist_builds_the_same_wheel(clone: Path, wheel: Path, tmp_path: Path) -> None:
    with tarfile.open(built("sdist", clone, tmp_path)) as archive:
        archive.extractall(tmp_path, filter="data")
    (source,) = (path for path in tmp_path.iterdir() if path.is_dir())
    assert contents(built("wheel", source, tmp_path)) == contents(wheel)
    tests = {path.name for path in (ROOT / "tests").glob("*.py")}
    assert {path.name for path in (source / "tests").iterdir()} == tests
    assert os.access(source / "run", os.X_OK)


def check(python: Path, folder: Path) -> None:
    """The package in an environment without FEniCSx."""
    names = (*ROOMS, "tests", "results", "run", "dolfinx")
    script = (
        "import sys, elastune\n"
        "from importlib.util import find_spec\n"
        f"assert [name for name in {names} if find_spec(name)] == [], sys.path\n"
        "print(elastune.__version__)\n"
    )
    said = call(python, "-c", script, cwd=folder, env=OUTSIDE)
    assert f'__version__ = "{said.strip()}"' in (ROOT / "__init__.py").read_text()
    assert "COMMAND" in call(python, "-m", "elastune", "--help", cwd=folder, env=OUTSIDE)


@pytest.mark.parametrize("kind", ["wheel", "editable"])
def test_what_is_unpacked_works_without_fenicsx(kind: str, clone: Path, tmp_path: Path) -> None:
    python, site = environment(tmp_path / "venv")
    with zipfile.ZipFile(built(kind, clone, tmp_path)) as archive:
        archive.extractall(site)
    assert not [name for name in (*ROOMS, "tests") if (site / name).exists()]
    check(python, tmp_path)
    where = call(python, "-c", "import elastune; print(elastune.__file__)", cwd=tmp_path, env=OUTSIDE).strip()
    assert Path(where).parent == (clone if kind == "editable" else site / "elastune")


# Slow: pip fetches the setuptools that it builds with.
@pytest.mark.slow
@pytest.mark.skipif(find_spec("pip") is None, reason="pip is not here")
@pytest.mark.parametrize("words", [["."], ["-e", "."]], ids=["plain", "editable"])
def test_pip_installs_the_checkout(words: list[str], tmp_path: Path) -> None:
    source = copied(tmp_path / "my-clone")
    python, site = environment(tmp_path / "venv")
    pip = [sys.executable, "-m", "pip", "--python", python, "--disable-pip-version-check"]
    call(*pip, "install", "--no-deps", *words, cwd=source, env=OUTSIDE)
    check(python, tmp_path)
    assert "COMMAND" in call(python.parent / "elastune", "--help", cwd=tmp_path, env=OUTSIDE)
    call(*pip, "uninstall", "--yes", "elastune", cwd=tmp_path, env=OUTSIDE)
    assert list(site.glob("*elastune*")) == []


# ---------------------------------------------------------------- from a checkout
# Elsewhere a launcher with an empty cache would build a root of its own.
fenicsx = pytest.mark.skipif(find_spec("dolfinx") is None, reason="./run would have to build a root")


@fenicsx
@pytest.mark.parametrize("name", ["my-clone", "elastune", "app"])
def test_a_clone_of_any_name_works(name: str, tmp_path: Path) -> None:
    source = copied(tmp_path / name)
    env = {**OUTSIDE, "ELASTUNE_CACHE": str(tmp_path / "cache")}
    run = source / "run"
    for cwd in (source, tmp_path):
        assert "COMMAND" in call(run, "elastune", "--help", cwd=cwd, env=env)
        where = call(run, "python3", "-c", "import elastune; print(elastune.__file__)", cwd=cwd, env=env)
        assert Path(where.strip()).resolve() == source / "__init__.py"
    assert "COMMAND" in call(run, "python3", "-m", "elastune", "--help", cwd=source, env=env)
    tests = [source / "tests/test_architecture.py", "-k", "the_wheel_has_every_folder"]
    assert "1 passed" in call(run, "python3", "-m", "pytest", "-q", *tests, cwd=source, env=env)
    assert "1 passed" in call(run, "pytest", "-q", *tests, cwd=source, env=env)
    # Seconds, and the same for any name but one that the package has inside.
    if name == "app" and shutil.which("mypy"):
        assert "no issues found" in call(run, "mypy", "-p", "elastune.geometry", cwd=source, env=env)


@fenicsx
def test_modules_of_the_folder_where_the_command_is_given_are_not_ours(tmp_path: Path) -> None:
    for name in ("elastune.py", "numbers.py", "argparse.py"):
        (tmp_path / name).write_text("raise SystemExit('not mine')\n")
    env = {**OUTSIDE, "ELASTUNE_CACHE": str(tmp_path / "cache")}
    assert "COMMAND" in call(ROOT / "run", "elastune", "--help", cwd=tmp_path, env=env)


def test_help_is_there_at_once(tmp_path: Path) -> None:
    def seconds() -> float:
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
        return usage.ru_utime + usage.ru_stime

    taken = []
    for _ in range(3):
        before = seconds()
        call(sys.executable, "-P", "-m", "elastune", "--help", cwd=tmp_path)
        taken.append(seconds() - before)
    # Of the processor, so that a busy machine does not matter.
    assert min(taken) < 0.3
