"""What goes wrong, by type: bad input is told in one line, and the solvers say where they stopped."""

from typing import Any


class UserError(Exception):
    """Bad input: one line with what was expected, what came, and where; exit status 2."""


class SceneError(UserError):
    """A scene that cannot be run."""


class NotConverged(Exception):
    """The minimiser stopped short.

    Attributes:
        kind: One word: "undefined", "indefinite", "stalled", "iterations", "linear", "time",
            "saddle", "crawling".
        values: The state where it stopped, a vector of the problem, or None.
    """

    def __init__(self, kind: str, message: str, values: Any = None) -> None:
        super().__init__(message)
        self.kind = kind
        self.values = values
