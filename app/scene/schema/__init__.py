"""The tables of a scene file, one module a kind."""

from elastune.app.scene.schema.conditions import Condition, End, Motions, Point
from elastune.app.scene.schema.material import Material, energy_of
from elastune.app.scene.schema.scene import (
    Scene,
    material_energies,
    material_energy,
    material_key,
    mesh_arguments,
    unmixed_keys,
)

__all__ = [
    "Condition",
    "End",
    "Material",
    "Motions",
    "Point",
    "Scene",
    "energy_of",
    "material_energies",
    "material_energy",
    "material_key",
    "mesh_arguments",
    "unmixed_keys",
]
