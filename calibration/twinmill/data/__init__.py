# SPDX-License-Identifier: Apache-2.0
"""Logs and tables of measurements: read, cleaned, put on one clock."""
