#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# sdformat 12.3.0 (Debian 12): a printed world is no XML once it includes a robot with `gz:expressed_in`.
#
# Guess: what `sdf --print room.sdf` writes is a file that any XML parser opens, as what it writes of
#   robot.sdf is: a robot that is included brings the address of its prefix along.
# Seen: the included robot keeps its attribute `gz:expressed_in`, but the root is the world's, and
#   xmlns:gz stood at the root of the robot's file: "unbound prefix". Gazebo itself does not mind; a
#   script that edits such a world has to declare the prefix at the world's root, in the file that
#   is printed.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
apt-get -o APT::Sandbox::User=root --quiet=2 download libsdformat12-12=12.3.0+ds-2 sdformat-sdf=12.3.0+ds-2 \
    libignition-math6-6 libtinyxml2-9 liburdfdom-model3.0 libconsole-bridge1.0 libtinyxml2.6.2v5
for package in *.deb; do dpkg -x "$package" .; done
library=$(find "$PWD" -name 'libsdformat12.so.12')
export SDF_PATH=$PWD/usr/share/sdformat12/1.9 LD_LIBRARY_PATH=${library%/*}


cat >robot.sdf <<'SDF'
<sdf version="1.9" xmlns:gz="http://gazebosim.org/schema"><model name="robot"><link name="base">
<collision name="wheel"><geometry><sphere><radius>1</radius></sphere></geometry>
<surface><friction><ode><fdir1 gz:expressed_in="base">1 1 0</fdir1></ode></friction></surface>
</collision></link></model></sdf>
SDF
room() { echo "<sdf version='1.9' $1><world name='room'><include><uri>$PWD/robot.sdf</uri></include></world></sdf>"; }
room '' >room.sdf
room 'xmlns:gz="http://gazebosim.org/schema"' >declared.sdf
python3 - "$library" robot.sdf room.sdf declared.sdf <<'PY'
import subprocess
import sys
import xml.etree.ElementTree as ET

code = "import ctypes, sys; ctypes.CDLL(sys.argv[1]).cmdPrint(sys.argv[2].encode(), 0, 0, 0, 17, 0)"
seen = {}
for name in sys.argv[2:]:
    printed = subprocess.check_output([sys.executable, "-c", code, sys.argv[1], name], text=True)
    assert "gz:expressed_in='base'" in printed
    try:
        ET.fromstring(printed)
        seen[name] = "XML"
    except ET.ParseError as error:
        seen[name] = str(error).partition(":")[0]
print(seen)
assert seen == {"robot.sdf": "XML", "room.sdf": "unbound prefix", "declared.sdf": "XML"}
PY
