# SPDX-License-Identifier: Apache-2.0
"""Blind test of diagnosis: effects drawn at random and sealed, diagnosed, unsealed, scored."""
