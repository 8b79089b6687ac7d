# SPDX-License-Identifier: Apache-2.0
"""Fits a model to measurements, and judges it on what it was not fitted to."""
