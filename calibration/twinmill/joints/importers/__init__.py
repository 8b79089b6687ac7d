# SPDX-License-Identifier: Apache-2.0
"""Logs of joints from other people's files.

Each file becomes signals (`signals`): `tables` reads CSV, npz and LeRobot's Parquet, `bags` ROS.
`names` finds the model's joints and actuators for them, `import_joints` puts them on one clock.
"""
