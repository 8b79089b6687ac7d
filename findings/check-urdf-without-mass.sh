#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# urdfdom 3.0.1 (Debian 12): check_urdf passes a file whose mass is no number, and a link on two joints.
#
# Guess: it ends with an error, as it does for a limit without an effort.
# Seen: "mass [1kg] is not a float" on stderr, then "Successfully Parsed XML" and exit status 0; the link
#   is there without mass or inertia. A link that is the child of two joints, which is no tree, passes
#   without any word. A script must read stderr, and count parents itself.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
apt-get -o APT::Sandbox::User=root --quiet=2 download liburdfdom-tools=3.0.1-1 liburdfdom-model3.0=3.0.1-1 \
    libconsole-bridge1.0 libtinyxml2.6.2v5
for package in *.deb; do dpkg -x "$package" .; done
library=$(dirname "$(find "$PWD" -name 'liburdfdom_model.so*' | head -n 1)")

# Checks a robot of that text: sets `status`, and keeps both outputs.
check()
{
    echo "<robot name='r'><link name='a'/>$1</robot>" >robot.urdf
    status=0
    LD_LIBRARY_PATH=$library usr/bin/check_urdf robot.urdf >said 2>wrong || status=$?
    echo "status $status: $(sed -n 2p said | tr -d -) $(head -n 1 wrong)"
}

joint()
{
    echo "<joint name='$1' type='$2'><parent link='$3'/><child link='$4'/>${5-}</joint>"
}

check "<link name='b'/>$(joint j revolute a b "<limit lower='-1' upper='1'/>")"
[ "$status" -ne 0 ]

inertia="<inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/>"
check "<link name='b'><inertial><mass value='1kg'/>$inertia</inertial></link>$(joint j fixed a b)"
[ "$status" -eq 0 ] && grep -q 'Successfully Parsed' said && grep -q 'not a float' wrong

check "<link name='b'/><link name='c'/>$(joint j fixed a b)$(joint k fixed a c)$(joint l fixed c b)"
[ "$status" -eq 0 ] && grep -q 'Successfully Parsed' said && [ ! -s wrong ]
