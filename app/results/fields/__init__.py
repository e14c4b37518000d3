"""The fields that a scene may ask for."""

from elastune.app.results.fields.local import CELL_FIELDS
from elastune.app.results.fields.whole import Fields

__all__ = ["CELL_FIELDS", "Fields"]
