"""Bad input, which is told in one line."""


class UserError(Exception):
    """Bad input: one line with what was expected, what came, and where; exit status 2."""


class SceneError(UserError):
    """A scene that cannot be run."""
