# SPDX-License-Identifier: Apache-2.0
"""Twinmill's diagnosis beside other ways to find what a model lacks, on the same sealed cases."""
