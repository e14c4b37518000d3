"""The one error this package raises."""


class GeometryError(ValueError):
    """A mesh that cannot be built as asked; one line: where, what came, what was expected."""
