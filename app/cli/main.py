"""The command line. What a command does not use it does not import: --help must not load dolfinx."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from elastune.app import interrupts
from elastune.app.cli import needs, proofs
from elastune.app.cli.endings import BAD_INPUT, NOT_CONVERGED, OK, failed, interrupted, rank, ranks
from elastune.app.cli.words import page, parser
from elastune.app.errors import UserError, meant


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a command; its exit status.

    Args:
        arguments: The words after `elastune`; those of the process by default, whose signals are then listened to.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    words, petsc = (words[: words.index("--")], words[words.index("--") + 1 :]) if "--" in words else (words, [])
    command = ""
    try:
        if arguments is None:
            interrupts.listen(lambda: interrupted(command))
            _speak(words)
        options = parser(proofs.BENCHES).parse_args(_readable(words))
        command = options.command or ""
        if petsc and command != "run":
            raise UserError(f"elastune {command}: takes no PETSc options, got {' '.join(petsc)}")
        status = _COMMANDS[command](options, petsc)
        if interrupts.came():
            interrupted(command)
        interrupts.ignore()
        return status
    except Exception as error:
        return failed(error, command)


def _readable(words: list[str]) -> list[str]:
    """Words that argparse does not take for others: a scene file may be called -h.toml."""
    if words and not words[0].startswith("-") and words[0] not in _COMMANDS:
        raise UserError(f"{words[0]}: no such command; {meant(words[0], filter(None, _COMMANDS))}")
    return [
        f"./{word}" if word.startswith("-") and word.endswith(".toml") and "=" not in word else word for word in words
    ]


def _speak(words: list[str]) -> None:
    """Says what a terminal cannot show in its own way, and once, where ranks do not share the work."""
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(errors="replace")  # type: ignore[union-attr]
    if rank() and words[:1] not in (["run"], ["stress"]):
        sys.stdout = open(os.devnull, "w")


def _start(options: Any, petsc: list[str]) -> int:
    print(page())
    return OK


def _run(options: Any, petsc: list[str]) -> int:
    from elastune.app.scene.read import load

    scene = load(options.scene, options.overrides)
    folder = options.out or Path("results") / scene.name

    needs.configure_petsc(petsc)
    needs.usable()
    from elastune.app.cli.screen import Screen
    from elastune.app.run import run

    with Screen(scene) as screen:
        summary, files = run(scene, folder, progress=screen)
        if summary.status != "interrupted":
            interrupts.ignore()
            screen.finish(summary, files)
    if summary.status == "interrupted" and summary.failure is not None:
        reached = summary.steps[-1].load if summary.steps else 0.0
        interrupted("run", f" at load {summary.failure.load:.4g}; results up to load {reached:.4g} in {folder}")
    return OK if summary.status == "converged" else NOT_CONVERGED


def _scenes(options: Any, petsc: list[str]) -> int:
    from elastune.app.scene.read import load, shipped

    if options.keys:
        from elastune.app.cli.console import console
        from elastune.app.scene.keys import keys

        screen = console()
        for key in keys():
            unit = f" [{key.unit}]" if key.unit else ""
            screen.print(f"{key.path} = {key.default}", style="bold", markup=False)
            screen.print(f"    {key.meaning}{unit}: {key.kind}", markup=False)
        return OK
    if options.schema:
        import json

        from elastune.app.scene.keys import schema

        print(json.dumps(schema(), indent=2, ensure_ascii=False))
        return OK
    for name in shipped():
        scene = load(name)
        print(f"{name:20} {scene.title}")
    return OK


def _materials(options: Any, petsc: list[str]) -> int:
    from elastune.app.cli.catalogue import show, table
    from elastune.app.cli.console import console
    from elastune.forms.energy import MaterialError

    try:
        if options.name is None:
            table(options.E, options.nu, console())
        else:
            show(options.name, options.E, options.nu, options.out, _material_table(options.overrides), console())
    except MaterialError as error:
        raise UserError(str(error)) from None
    except OSError as error:
        raise UserError(f"--out {options.out}: cannot be written: {error.strerror}") from None
    return OK


def _doctor(options: Any, petsc: list[str]) -> int:
    needs.configure_petsc()
    from elastune.app.cli.doctor import Examination

    examination = Examination()
    for line in examination.lines():
        print(line)
    return OK if examination.usable else BAD_INPUT


def _clean(options: Any, petsc: list[str]) -> int:
    from elastune.app.cli.caches import clean

    if ranks() > 1:
        raise UserError("elastune clean: expected one process")
    for what, size in clean(options.pretend):
        print(f"{'would remove' if options.pretend else 'removed'} {what}: {size / 1e6:.0f} MB")
    return OK


def _material_table(overrides: Sequence[str]) -> dict[str, Any]:
    """The keys of a scene's material table that `tuned_energy` takes beside name, E and nu."""
    if not overrides:
        return {}
    from elastune.app.scene.override import override
    from elastune.app.scene.schema import Material

    table: dict[str, Any] = {}
    for assignment in overrides:
        override(table, assignment)
    known = set(Material.model_fields) - {"name", "E", "nu", "extension"}
    for key in table:
        if key not in known:
            raise UserError(f"--set {key}: {meant(key, sorted(known))}")
    return table


_COMMANDS = {
    "": _start,
    "run": _run,
    "scenes": _scenes,
    "materials": _materials,
    "converge": proofs.converge,
    "stress": proofs.stress,
    "bench": proofs.bench,
    "doctor": _doctor,
    "clean": _clean,
}
