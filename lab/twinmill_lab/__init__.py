# SPDX-License-Identifier: Apache-2.0
"""For an article, not for a robot: blind tests of diagnosis, and published claims run again."""
