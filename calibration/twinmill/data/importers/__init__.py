# SPDX-License-Identifier: Apache-2.0
"""Measurements of others, as logs like a robot's own."""
