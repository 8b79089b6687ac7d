# SPDX-License-Identifier: Apache-2.0
"""Model files, and which of their quantities a fit may change."""
