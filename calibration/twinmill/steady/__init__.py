# SPDX-License-Identifier: Apache-2.0
"""Steady-state tables: what a stopwatch and a tape measure tell of a robot."""
