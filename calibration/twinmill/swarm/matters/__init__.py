# SPDX-License-Identifier: Apache-2.0
"""Which effect and which number of a model matters for what the swarm does."""
