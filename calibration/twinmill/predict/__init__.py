# SPDX-License-Identifier: Apache-2.0
"""Predictions beside measurements: errors, their noise, their floor."""
