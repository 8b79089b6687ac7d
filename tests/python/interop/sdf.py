# SPDX-License-Identifier: Apache-2.0
"""SDF: sdformat, and the physics of Gazebo."""

from interop.cells import Cell

NOT_RUN = [
    Cell("SDF", "writes", "Gazebo Sim", why_not="no package registry has the whole program"),
]
