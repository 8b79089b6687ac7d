# SPDX-License-Identifier: Apache-2.0
"""From logs and a model to errors, causes and a better model; and what swarms do."""
