# SPDX-License-Identifier: Apache-2.0
"""Logs for other programs: MCAP, CSV, Parquet."""
