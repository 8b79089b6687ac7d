# SPDX-License-Identifier: Apache-2.0
"""Search for behaviours that nobody thought of."""
