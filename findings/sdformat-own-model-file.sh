#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# sdformat 12.3.0 (Debian 12): a robot's model.sdf in the folder that one stands in is not opened.
#
# Guess: `sdf --check model.sdf` checks the file of that name here, as it does robot.sdf.
# Seen: "Unable to read file". A name without a folder is first looked up among the library's own
#   descriptions of its elements, and one of them is called model.sdf, as most robots' files are; so
#   are world, link, joint, camera and some dozens more. A whole path opens the right one. The
#   packages are not installed here, so SDF_PATH names the folder that they would be found in.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
apt-get -o APT::Sandbox::User=root --quiet=2 download libsdformat12-12=12.3.0+ds-2 sdformat-sdf=12.3.0+ds-2 \
    libignition-math6-6 libtinyxml2-9 liburdfdom-model3.0 libconsole-bridge1.0 libtinyxml2.6.2v5
for package in *.deb; do dpkg -x "$package" .; done
library=$(find "$PWD" -name 'libsdformat12.so.12')
export SDF_PATH=$PWD/usr/share/sdformat12/1.9 LD_LIBRARY_PATH=${library%/*}

# What `sdf --check` calls; 0 if the file is valid.
check() { python3 -c 'import ctypes, sys; ctypes.CDLL(sys.argv[1]).cmdCheck(sys.argv[2].encode())' "$library" "$1" 2>&1; }

echo '<sdf version="1.9"><model name="robot"><link name="base"/></model></sdf>' >robot.sdf
cp robot.sdf model.sdf
for name in robot.sdf model.sdf "$PWD/model.sdf"; do
    echo "${name##"$PWD"}: $(check "$name" | tail -n 1)"
done
check robot.sdf | grep -q '^Valid'
check "$PWD/model.sdf" | grep -q '^Valid'
check model.sdf | grep -q 'Unable to read file'
