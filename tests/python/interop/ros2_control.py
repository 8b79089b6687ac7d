# SPDX-License-Identifier: Apache-2.0
"""Parameters for the controllers of ros2_control, read by ROS 2's own parser of such files."""

import ctypes
import math
from pathlib import Path

from interop.cells import Cell, Told, writes
from interop.robot import FORWARD_GAIN, TEXT, TOP_MPS, WHEEL_RADIUS_M, WHEELS, write
from interop.rosbag import ROS2

KINDS = (
    ("bool", ctypes.c_bool),
    ("integer", ctypes.c_int64),
    ("double", ctypes.c_double),
    ("string", ctypes.c_char),
)
KINDS += tuple((f"{kind}s", ctypes.c_void_p) for kind in ("byte", "bool", "integer", "double"))
KINDS += (("strings", ctypes.c_void_p),)


class _Variant(ctypes.Structure):
    """`rcl_variant_t`: of these pointers one leads to the value."""

    _fields_ = [(kind, ctypes.POINTER(points_at)) for kind, points_at in KINDS]


class _Strings(ctypes.Structure):
    """`rcutils_string_array_t`, its first two fields."""

    _fields_ = [("size", ctypes.c_size_t), ("data", ctypes.POINTER(ctypes.c_char_p))]


class _Allocator(ctypes.Structure):
    _fields_ = [(f"pointer_{k}", ctypes.c_void_p) for k in range(5)]


def _write(folder: Path) -> None:
    for wheels in ("mecanum", "differential"):
        text = TEXT.replace('"mecanum"', f'"{wheels}"')
        write(folder, "ros2_control", text).rename(folder / f"{wheels}.yaml")


@writes("ros2_control", "ROS 2 Jazzy, its parameters", *ROS2, ours=_write)
def rcl(folder: Path) -> Told:
    """`rcl_parse_yaml_file`; a controller refuses a number of another type than it declares."""
    mecanum, name = _parameters(folder / "mecanum.yaml"), "mecanum_drive_controller"
    plain = _parameters(folder / "differential.yaml")
    left = [f"{wheel}_wheel_joint" for wheel in WHEELS if wheel.endswith("l")]
    radius_m = WHEEL_RADIUS_M * FORWARD_GAIN
    tops = [
        told(node, f"{axis}.max_velocity")
        for told, node, axes in (
            (mecanum, name, ("linear.x", "linear.y")),
            (plain, "diff_drive_controller", ("linear.x",)),
        )
        for axis in axes
    ]
    joints = [mecanum(name, f"{k}_wheel_command_joint_name") for k in ("front_left", "rear_right")]
    return {
        "rate, a whole number": mecanum("controller_manager", "update_rate") == ("integer", 45),
        "type of the controller": mecanum("controller_manager", f"{name}.type")
        == ("string", f"{name}/MecanumDriveController"),
        "joints": joints == [("string", f"{wheel}_wheel_joint") for wheel in ("fl", "rr")],
        "radius of mecanum wheels": _is(mecanum(name, "kinematics.wheels_radius"), radius_m),
        "no offset, a number": _is(mecanum(name, "kinematics.base_frame_offset.x"), 0),
        "radius of plain wheels": _is(plain("diff_drive_controller", "wheel_radius"), radius_m),
        "top speeds, numbers": all(_is(top, TOP_MPS * FORWARD_GAIN) for top in tops),
        "joints, a list": plain("diff_drive_controller", "left_wheel_names") == ("strings", left),
    }


def _is(told: tuple[str, object], value: float) -> bool:
    kind, number = told
    return kind == "double" and math.isclose(number, value, rel_tol=1e-4)


def _parameters(path: Path):
    """Type and value by the names of node and parameter."""
    library, utilities = (
        ctypes.CDLL(f"lib{name}.so") for name in ("rcl_yaml_param_parser", "rcutils")
    )
    utilities.rcutils_get_default_allocator.restype = _Allocator
    library.rcl_yaml_node_struct_init.argtypes = [_Allocator]
    library.rcl_yaml_node_struct_init.restype = ctypes.c_void_p
    library.rcl_parse_yaml_file.argtypes = [ctypes.c_char_p, ctypes.c_void_p]
    library.rcl_parse_yaml_file.restype = ctypes.c_bool
    get = library.rcl_yaml_node_struct_get
    get.argtypes = [ctypes.c_char_p, ctypes.c_char_p, ctypes.c_void_p]
    get.restype = ctypes.POINTER(_Variant)
    held = library.rcl_yaml_node_struct_init(utilities.rcutils_get_default_allocator())
    assert library.rcl_parse_yaml_file(str(path).encode(), held), path

    def told(node: str, parameter: str) -> tuple[str, object]:
        variant = get(node.encode(), parameter.encode(), held).contents
        (kind,) = (kind for kind, _ in KINDS if getattr(variant, kind))
        pointer = getattr(variant, kind)
        if kind == "string":
            return kind, ctypes.string_at(pointer).decode()
        if kind == "strings":
            names = ctypes.cast(pointer, ctypes.POINTER(_Strings)).contents
            return kind, [names.data[k].decode() for k in range(names.size)]
        return kind, pointer.contents.value

    return told


NOT_RUN = [
    Cell(
        "ros2_control",
        "writes",
        "ros2_control, the program",
        why_not="no package registry has it",
    ),
]
