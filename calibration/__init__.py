# SPDX-License-Identifier: Apache-2.0
"""Calibration: from logs and a model to errors, causes and a better model."""
