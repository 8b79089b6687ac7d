# SPDX-License-Identifier: Apache-2.0
"""The catalogue of what an MJCF may lack: one class for each effect, one file for each kind."""

from twinmill.joints.effects.actuation import (
    CommandDeadZone,
    CommandDelay,
    CommandLag,
    CommandPlay,
    Gain,
    Saturation,
    ServoDamping,
    ServoStiffness,
    SupplyDrift,
)
from twinmill.joints.effects.effect import Effect
from twinmill.joints.effects.friction import (
    Coulomb,
    CoulombByDirection,
    Drag,
    FrictionByPosition,
    LoadFriction,
    Stribeck,
    Viscous,
    ViscousByDirection,
)
from twinmill.joints.effects.inertia import Armature, LinkMass
from twinmill.joints.effects.position import EncoderOffset, ForceOffset, Stiffness, Tilt
from twinmill.joints.plant import Plant

KINDS: tuple[type[Effect], ...] = (
    Coulomb,
    CoulombByDirection,
    Viscous,
    ViscousByDirection,
    Drag,
    Stribeck,
    LoadFriction,
    FrictionByPosition,
    Armature,
    LinkMass,
    Gain,
    ServoStiffness,
    ServoDamping,
    CommandDelay,
    CommandLag,
    CommandDeadZone,
    CommandPlay,
    Saturation,
    SupplyDrift,
    ForceOffset,
    EncoderOffset,
    Stiffness,
    Tilt,
)


def effects_of(plant: Plant) -> dict[str, Effect]:
    """Every effect that a robot can have, by name: `viscous_friction@elbow`."""
    found = (effect for kind in KINDS for effect in kind.all_of(plant))
    return {effect.name: effect for effect in found}
