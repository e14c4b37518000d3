"""The words of the command line: commands and their options."""

import argparse
from collections.abc import Iterable
from pathlib import Path
from typing import NoReturn

from elastune.app.errors import UserError


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
    commands = top.add_subparsers(dest="command", metavar="COMMAND", required=True)

    command = commands.add_parser(
        "run",
        help="solve a scene and write its results",
        description="Solves a scene; exit status 2 for bad input, 3 if the run does not converge.",
        epilog="Options of PETSc follow after --, as in: elastune run cube-pull -- -snes_monitor",
    )
    command.add_argument("scene", help="a scene file, or the name of a shipped scene")
    _overrides(command, "replace a key of the scene, e.g. material.alpha=0.5; may be repeated")
    command.add_argument("--out", type=Path, metavar="DIR", help="folder of the results (default: results/SCENE)")

    commands.add_parser("scenes", help="list the shipped scenes")

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
    command.add_argument("name", choices=sorted(benches), help="what is measured")
    command.add_argument("--out", type=Path, metavar="DIR", default=Path("results/bench"), help="folder of the results")
    extent = command.add_mutually_exclusive_group()
    extent.add_argument("--quick", action="store_true", help="kernels: two materials only")
    extent.add_argument(
        "--all",
        dest="everything",
        action="store_true",
        help="kernels: UFL's form of every stretch-based material too, which take long to compile",
    )
    return top


def _overrides(command: argparse.ArgumentParser, meaning: str) -> None:
    command.add_argument("--set", dest="overrides", metavar="KEY=VALUE", action="append", default=[], help=meaning)
