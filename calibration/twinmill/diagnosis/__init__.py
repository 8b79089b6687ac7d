# SPDX-License-Identifier: Apache-2.0
"""From logs to a better model: `inference` on one robot, several, or tables."""
