# SPDX-License-Identifier: Apache-2.0
"""Robots on the network: who is there, what they say, and commands that they acknowledge."""
