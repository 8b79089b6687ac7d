# SPDX-License-Identifier: Apache-2.0
"""Learns which physical effect a model lacks."""
