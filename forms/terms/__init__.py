"""Π as a sum of named terms: what each adds to energy, forces and tangent."""

from elastune.forms.terms.dead_loads import DeadLoads, NodalLoads
from elastune.forms.terms.domain import Domain, face_degree
from elastune.forms.terms.follower import FollowerPressure
from elastune.forms.terms.foundation import Foundation
from elastune.forms.terms.pattern import pattern
from elastune.forms.terms.pressure_field import PressureField, Share, mixed_response
from elastune.forms.terms.strain import StrainEnergy
from elastune.forms.terms.term import RAW, Convexity, Fields, Term

__all__ = [
    "RAW",
    "Convexity",
    "DeadLoads",
    "Domain",
    "Fields",
    "FollowerPressure",
    "Foundation",
    "NodalLoads",
    "PressureField",
    "Share",
    "StrainEnergy",
    "Term",
    "face_degree",
    "mixed_response",
    "pattern",
]
