#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# ROS 2 Jazzy (rcl 9.2.8): of a parameter file that PyYAML 6.0.3 wrote, the text y is true for ROS.
#
# Guess: a text that yaml.safe_dump writes bare (it puts quotes about on, yes and no) is a text to every
#   reader of YAML; axes: [x, y, z] is a list of three texts.
# Seen: y comes as the bool true, n as false, x as a text; the texts 1e3 and inf, bare as well, come as numbers;
#   and of axes: [x, y, z] the whole file is refused: "Sequence should be of same type".
#
# The wheels are for Python 3.11 and 3.12. No node is made, so nothing goes out on a network.
set -euo pipefail

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder"
"$folder/bin/pip" install --quiet --no-compile 'ros-jazzy-rclpy[fastrtps]==7.1.6' PyYAML==6.0.3

cd "$folder"
cat >written.py <<'PROGRAM'
import ctypes
import sys

import yaml


class Allocator(ctypes.Structure):
    _fields_ = [(f"pointer_{k}", ctypes.c_void_p) for k in range(5)]


class Sentence(ctypes.Structure):
    _fields_ = [("text", ctypes.c_char * 1024)]


values = {
    "words": {"axis": "y", "other": "x", "answer": "n", "quoted": "yes", "number": "1e3", "far": "inf"},
    "axes": {"axes": ["x", "y", "z"]},
}[sys.argv[1]]
text = yaml.safe_dump({"node": {"ros__parameters": values}})
assert yaml.safe_load(text)["node"]["ros__parameters"] == values
print(text, flush=True)
with open("parameters.yaml", "w") as file:
    file.write(text)
utilities, parser = ctypes.CDLL("librcutils.so"), ctypes.CDLL("librcl_yaml_param_parser.so")
utilities.rcutils_get_default_allocator.restype = Allocator
parser.rcl_yaml_node_struct_init.argtypes = [Allocator]
parser.rcl_yaml_node_struct_init.restype = ctypes.c_void_p
parser.rcl_parse_yaml_file.argtypes = [ctypes.c_char_p, ctypes.c_void_p]
parser.rcl_parse_yaml_file.restype = ctypes.c_bool
parser.rcl_yaml_node_struct_print.argtypes = [ctypes.c_void_p]
utilities.rcutils_get_error_string.restype = Sentence
held = parser.rcl_yaml_node_struct_init(utilities.rcutils_get_default_allocator())
if parser.rcl_parse_yaml_file(b"parameters.yaml", held):
    parser.rcl_yaml_node_struct_print(held)
else:
    print(utilities.rcutils_get_error_string().text.decode())
ctypes.CDLL(None).fflush(None)
PROGRAM

bin/python written.py words | tee words
bin/python written.py axes | tee axes
seen() { tr -s ' ' <"$1" | grep --quiet -- "$2" || { echo "it does otherwise now: $2" >&2; exit 1; }; }
seen words 'axis: y'
seen words 'axis: true'
seen words 'answer: false'
seen words 'other: x'
seen words 'quoted: yes'
seen words 'number: 1000.0'
seen words 'far: inf'
seen axes '- y'
seen axes 'Sequence should be of same type'
