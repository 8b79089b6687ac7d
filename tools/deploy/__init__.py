# SPDX-License-Identifier: Apache-2.0
"""Robots over ssh: their program, its configuration, its scripts."""
