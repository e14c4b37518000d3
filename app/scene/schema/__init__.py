"""The tables of a scene file, one module a kind."""

from elastune.app.scene.schema.conditions import Condition
from elastune.app.scene.schema.material import Material
from elastune.app.scene.schema.scene import Scene, material_energy, mesh_arguments, unmixed_keys

__all__ = ["Condition", "Material", "Scene", "material_energy", "mesh_arguments", "unmixed_keys"]
