#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Drake 1.51.1: of one joint's limits it keeps the effort, and lets it turn at ten times its velocity.
#
# Guess: a joint with <limit effort="1" velocity="10"/>, told 5 Nm for a second, turns at 10 rad/s in the
#   end, or at 500 if limits are for the controller alone; and the same joint in SDF does the same.
# Seen: 100 rad/s: the torque is cut to 1 Nm, the speed is not, though the joint says that its upper limit is
#   10 rad/s; no warning. In SDF the joint has a motor; in URDF only if a <transmission> names it, and without
#   one it has none, again without a word.
set -euo pipefail

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install --quiet --no-compile drake==1.51.1

"$folder/bin/python" - <<'PROGRAM'
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

INERTIA = 'ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"'
URDF = f"""<robot name="robot">
<link name="base"><inertial><mass value="1"/><inertia {INERTIA}/></inertial></link>
<link name="wheel"><inertial><mass value="0.1"/><inertia {INERTIA}/></inertial></link>
<joint name="axle" type="continuous"><parent link="base"/><child link="wheel"/>
<axis xyz="0 0 1"/><limit effort="1" velocity="10"/></joint>
<!--motor--></robot>"""
MOTOR = """<transmission><type>transmission_interface/SimpleTransmission</type>
<joint name="axle"/><actuator name="motor"/></transmission>"""
SDF = """<sdf version="1.9"><model name="robot"><link name="base"/>
<link name="wheel"><inertial><mass>0.1</mass>
<inertia><ixx>0.01</ixx><iyy>0.01</iyy><izz>0.01</izz></inertia></inertial></link>
<joint name="axle" type="revolute"><parent>base</parent><child>wheel</child>
<axis><xyz>0 0 1</xyz><limit><effort>1</effort><velocity>10</velocity></limit></axis></joint>
</model></sdf>"""


def driven(text, kind):
    """Motors, the joint's own limit, and its speed after a second at 5 Nm (none without a motor)."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 0.001)
    Parser(plant).AddModelsFromString(text, kind)
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
    plant.Finalize()
    simulator = Simulator(builder.Build())
    context = plant.GetMyContextFromRoot(simulator.get_mutable_context())
    if plant.num_actuators():
        plant.get_actuation_input_port().FixValue(context, [5.0])
    simulator.AdvanceTo(1.0)
    top_radps = plant.GetJointByName("axle").velocity_upper_limits()[0]
    return plant.num_actuators(), float(top_radps), round(float(plant.GetVelocities(context)[0]), 6)


seen = [driven(URDF, "urdf"), driven(URDF.replace("<!--motor-->", MOTOR), "urdf"), driven(SDF, "sdf")]
print(seen)
raise SystemExit(
    "it does otherwise now" if seen != [(0, 10, 0), (1, 10, 100), (1, 10, 100)] else 0
)
PROGRAM
