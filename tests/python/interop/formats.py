# SPDX-License-Identifier: Apache-2.0
"""All cells, in the order of the table; a new format's module is named here."""

from interop import (
    capture,
    films,
    lcm_log,
    mcap_file,
    mjcf,
    rerun_file,
    ros2_control,
    ros_node,
    rosbag,
    script_bag,
    sdf,
    tables,
    tags,
    urdf,
)
from interop.cells import cells_of

MODULES = (mjcf, urdf, ros2_control, ros_node, sdf, rosbag, script_bag, mcap_file, lcm_log)
MODULES += (tables, rerun_file, films, tags, capture)
CELLS = [cell for module in MODULES for cell in cells_of(module)]
