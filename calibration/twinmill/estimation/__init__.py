# SPDX-License-Identifier: Apache-2.0
"""Numbers of a model by least squares and by likelihood, and a log on the clock that suits it."""
