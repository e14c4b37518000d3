"""The words of the command line: commands and their options."""

import argparse
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import NoReturn

from elastune import __version__
from elastune.app.errors import UserError, meant

# Only a checkout has pages in it.
ROOT = Path(__file__).resolve().parents[2]
PAGES = ("README.md", "results/README.md")


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise UserError(f"{message}; see {self.prog} --help")


def parser(benches: Iterable[str]) -> argparse.ArgumentParser:
    """Of all commands.

    Args:
        benches: Names of the benchmarks.
    """
    top = _Parser(
        prog="elastune",
        description="Tunes hyperelastic materials and proves the result by finite elements.",
    )
    commands = top.add_subparsers(dest="command", metavar="COMMAND")

    command = commands.add_parser(
        "run",
        help="solve a scene and write its results",
        description="Solves a scene; exit status 2 for bad input, 3 if the run does not converge.",
        epilog="Options of PETSc follow after --, as in: elastune run cube-pull -- -snes_monitor",
    )
    command.add_argument("scene", help="a scene file, or the name of a shipped scene")
    _overrides(command, "replace a key of the scene, e.g. material.alpha=0.5; may be repeated")
    command.add_argument("--out", type=Path, metavar="DIR", help="folder of the results (default: results/SCENE)")

    command = commands.add_parser("scenes", help="list the shipped scenes, or the keys of a scene")
    shown = command.add_mutually_exclusive_group()
    shown.add_argument("--keys", action="store_true", help="every key of a scene: default, kind, meaning and unit")
    shown.add_argument("--schema", action="store_true", help="the JSON schema of a scene, for editors")

    command = commands.add_parser(
        "materials",
        help="list the materials, or show one with its uniaxial curve",
        description="Without a name, all materials calibrated to E and nu; with one, its parameters and a curve.",
    )
    command.add_argument("name", nargs="?", help="a material")
    command.add_argument("--E", type=float, default=1.0, help="Young's modulus (default 1)")
    command.add_argument("--nu", type=float, default=0.3, help="Poisson's ratio (default 0.3)")
    _overrides(command, "with a name: alpha=2, volume=hencky, parameters.mu=1.0, as in a scene's material table")
    command.add_argument(
        "--out", type=Path, metavar="DIR", default=Path("results/materials"), help="folder of the curve"
    )

    command = commands.add_parser(
        "converge",
        help="run a study of errors against run time",
        description="Runs what its folder lacks of a study, each case in its own process; draws tables and figures.",
    )
    command.add_argument("study", nargs="?", help="a study file, or the name of a shipped study; none lists them")
    command.add_argument(
        "--out", type=Path, metavar="DIR", help="folder of the results (default: results/converge/STUDY)"
    )

    command = commands.add_parser(
        "stress",
        help="put every material through the scenes that break solvers",
        description="Solves every material, scene, nu and cell that results/stress/stress.csv lacks; with mpirun, "
        "each rank takes cases of its own.",
    )
    command.add_argument("--material", action="append", help="only this material; may be repeated")
    command.add_argument("--limit", type=float, default=30.0, metavar="S", help="seconds a case may take (default 30)")
    command.add_argument("--out", type=Path, metavar="DIR", default=Path("results/stress"), help="folder of the table")

    command = commands.add_parser("bench", help="time the solver against others")
    command.add_argument("name", type=_one_of(sorted(benches)), help=f"what is measured: {', '.join(sorted(benches))}")
    command.add_argument("--out", type=Path, metavar="DIR", default=Path("results/bench"), help="folder of the results")
    extent = command.add_mutually_exclusive_group()
    extent.add_argument("--quick", action="store_true", help="kernels: two materials only")
    extent.add_argument(
        "--all",
        dest="everything",
        action="store_true",
        help="kernels: UFL's form of every stretch-based material too, which take long to compile",
    )

    commands.add_parser(
        "doctor",
        help="tell what is installed, what is missing or slow, and how to mend it",
        description="Exit status 2 if scenes cannot be run; with mpirun, all ranks together.",
    )

    command = commands.add_parser(
        "clean",
        help="remove compiled kernels and unused roots",
        description="Removes compiled kernels, which are compiled again when needed, and Debian roots that no checkout "
        "uses any more. Not while something runs.",
    )
    command.add_argument("--dry-run", dest="pretend", action="store_true", help="tell only what would be removed")
    return top


def _one_of(known: Sequence[str]) -> Callable[[str], str]:
    """A type for `argparse`: one of some words."""

    def word(given: str) -> str:
        if given not in known:
            raise argparse.ArgumentTypeError(f"{given!r}: {meant(given, known)}")
        return given

    return word


def _overrides(command: argparse.ArgumentParser, meaning: str) -> None:
    command.add_argument("--set", dest="overrides", metavar="KEY=VALUE", action="append", default=[], help=meaning)


def page() -> str:
    """What `elastune` alone shows: where to begin."""
    told = ", ".join(str(ROOT / name) for name in PAGES if (ROOT / name).is_file())
    return f"""\
elastune {__version__} tunes hyperelastic materials and proves the result by finite elements.

  elastune run cube-pull       solves a shipped scene
  elastune scenes              lists the shipped scenes
  elastune materials fung      shows a material and draws its curve

Results go to the folder results/ here, those of a run to results/SCENE.
All commands: elastune --help. What is installed: elastune doctor.
Documentation: {told or " and ".join(PAGES) + " of the project"}"""
