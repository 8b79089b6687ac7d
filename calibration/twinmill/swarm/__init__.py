# SPDX-License-Identifier: Apache-2.0
"""Many swarms over a grid of parameters: run, keep, and go on after a kill."""
