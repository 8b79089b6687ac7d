# SPDX-License-Identifier: Apache-2.0
"""One robot on several days: what changed between two runs, and how its numbers drift."""
