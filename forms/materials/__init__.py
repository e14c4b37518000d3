"""The catalogue of materials: importing this package registers every one."""

from elastune.forms.energy import CATALOGUE, Energy, Material, MaterialError
from elastune.forms.materials import geometric, linear, neo_hookean, rubber, seth_hill, stabilised, valanis_landel

__all__ = [
    "CATALOGUE",
    "geometric",
    "get",
    "linear",
    "make",
    "neo_hookean",
    "rubber",
    "seth_hill",
    "stabilised",
    "valanis_landel",
]


def get(name: str) -> Material:
    """The catalogue's entry of that name.

    Raises:
        MaterialError: If there is none; the message names the nearest.
    """
    if name not in CATALOGUE:
        import difflib

        near = difflib.get_close_matches(str(name), CATALOGUE, 3, 0.4)
        hint = f"did you mean {' or '.join(near)}?" if near else "`elastune materials` lists them"
        raise MaterialError(f"unknown material {name!r}; {hint}")
    return CATALOGUE[name]


def make(name: str, **given: object) -> Energy:
    """The energy of that name with the given parameters and options.

    Raises:
        MaterialError: If the name or a parameter is unknown, or a value impossible.
    """
    return get(name).energy(**given)
