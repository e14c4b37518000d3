"""Bad input, which is told in one line."""

from collections.abc import Iterable


class UserError(Exception):
    """Bad input: one line with what was expected, what came, and where; exit status 2."""


class SceneError(UserError):
    """A scene that cannot be run."""


def meant(word: object, known: Iterable[str], otherwise: str = "expected one of") -> str:
    """What a word that is not known may have been meant for, as the end of an error's line.

    Args:
        word: What came.
        known: What could have come.
        otherwise: What is said before all that is known if nothing is near.
    """
    # Loaded where something is wrong, and not before.
    import difflib

    names = list(known)
    near = difflib.get_close_matches(str(word), names, 1)
    return f"did you mean {near[0]}?" if near else f"{otherwise} {', '.join(names)}"
