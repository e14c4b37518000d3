"""Tunes hyperelastic materials and proves the result by finite elements.

In a script or a notebook:

    import elastune

    fung = elastune.material("fung", E=1.0, nu=0.45, alpha=0.9)
    stress, lateral = fung.uniaxial([0.8, 1.0, 1.5])
    run = elastune.solve(elastune.scene("cube-pull", {"mesh.cells": 4, "material.alpha": 0.5}))
    for record in run:
        print(record.load, record.energy, run.fields("von_mises")["von_mises"].max())
    run.plot().savefig("curve.png")
    cube = elastune.geometry.build(run.body.comm, shape="cube", cells=4)
    ends = {"left": elastune.Clamp(), "right": elastune.Pull((0.1, 0.0, 0.0))}
    forces = elastune.solve(elastune.body(cube, fung, ends)).history["reaction_left"]

Every name is loaded when it is first used: importing this package loads neither dolfinx nor numpy.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from elastune import geometry as geometry
    from elastune.app.api.body import body as body
    from elastune.app.api.material import Material as Material
    from elastune.app.api.material import material as material
    from elastune.app.api.material import materials as materials
    from elastune.app.api.scene import scene as scene
    from elastune.app.api.scene import solve as solve
    from elastune.app.body.body import Body as Body
    from elastune.app.body.conditions.loads import BodyForce as BodyForce
    from elastune.app.body.conditions.loads import Force as Force
    from elastune.app.body.conditions.loads import Moment as Moment
    from elastune.app.body.conditions.loads import NormalPull as NormalPull
    from elastune.app.body.conditions.loads import Pressure as Pressure
    from elastune.app.body.conditions.loads import Pull as Pull
    from elastune.app.body.conditions.loads import Spring as Spring
    from elastune.app.body.conditions.motions import Clamp as Clamp
    from elastune.app.body.conditions.motions import Roller as Roller
    from elastune.app.body.conditions.motions import Rotation as Rotation
    from elastune.app.body.conditions.motions import Translation as Translation
    from elastune.app.body.conditions.places import Curve as Curve
    from elastune.app.body.conditions.places import Point as Point
    from elastune.app.errors import UserError as UserError
    from elastune.app.run import Run as Run
    from elastune.app.scene.schema import Scene as Scene
    from elastune.app.solvers.options import Options as Options
    from elastune.forms.energy import Exponent as Exponent
    from elastune.forms.energy import MaterialError as MaterialError
    from elastune.forms.energy import Modulus as Modulus
    from elastune.forms.energy import Number as Number
    from elastune.forms.energy import Parts as Parts
    from elastune.forms.energy import PositiveModulus as PositiveModulus
    from elastune.forms.expressions import Expression as Expression
    from elastune.geometry import Geometry as Geometry

__version__ = "0.1.0"

# The same names, by the module that each is loaded from.
_HOMES = {
    "app.api.body": ("body",),
    "app.api.material": ("Material", "material", "materials"),
    "app.api.scene": ("scene", "solve"),
    "app.body.body": ("Body",),
    "app.body.conditions.loads": ("BodyForce", "Force", "Moment", "NormalPull", "Pressure", "Pull", "Spring"),
    "app.body.conditions.motions": ("Clamp", "Roller", "Rotation", "Translation"),
    "app.body.conditions.places": ("Curve", "Point"),
    "app.errors": ("UserError",),
    "app.run": ("Run",),
    "app.scene.schema": ("Scene",),
    "app.solvers.options": ("Options",),
    "forms.energy": ("Exponent", "MaterialError", "Modulus", "Number", "Parts", "PositiveModulus"),
    "forms.expressions": ("Expression",),
    "geometry": ("Geometry",),
}
_FENICSX = ("basix", "dolfinx", "ffcx", "mpi4py", "petsc4py", "slepc4py", "ufl")

# Unseen by type checkers, to whom a module with this function has every name.
if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        if name == "geometry":
            return import_module("elastune.geometry")
        for home, names in _HOMES.items():
            if name in names:
                try:
                    value = getattr(import_module(f"elastune.{home}"), name)
                except ModuleNotFoundError as error:
                    if str(error.name).partition(".")[0] not in _FENICSX:
                        raise
                    needed = "FEniCSx (dolfinx 0.9 or newer, petsc4py, slepc4py), which pip does not install"
                    raise ImportError(f"elastune.{name} needs {needed}: {error}") from None
                globals()[name] = value
                return value
        raise AttributeError(f"module 'elastune' has no attribute {name!r}")

    def __dir__() -> list[str]:
        return sorted({*globals(), "geometry", *(name for names in _HOMES.values() for name in names)})
