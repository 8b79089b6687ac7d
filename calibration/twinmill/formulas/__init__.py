# SPDX-License-Identifier: Apache-2.0
"""Formulas that a motion may lack: their terms, forms, units, and what they change in a log."""
