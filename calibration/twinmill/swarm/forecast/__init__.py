# SPDX-License-Identifier: Apache-2.0
"""A prediction of real runs that can fail: cells chosen, probabilities sealed, outcomes scored."""
