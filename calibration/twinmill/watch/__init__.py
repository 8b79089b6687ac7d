# SPDX-License-Identifier: Apache-2.0
"""Robots and their twins side by side in a viewer, live or from a log."""
