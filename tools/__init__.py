# SPDX-License-Identifier: Apache-2.0
"""Command lines: logs, import, calibration, the swarm."""
