# SPDX-License-Identifier: Apache-2.0
"""Designs the next run: the input script that best tells apart what the logs so far cannot."""
