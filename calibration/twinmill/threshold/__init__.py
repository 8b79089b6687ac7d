# SPDX-License-Identifier: Apache-2.0
"""The green that a robot looks for, from pictures of its own camera."""
