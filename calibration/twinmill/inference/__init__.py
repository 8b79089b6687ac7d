# SPDX-License-Identifier: Apache-2.0
"""Bayesian model comparison: probabilities of the effects and dependences that a model lacks.

The data flow one way: `steps` (prediction errors of a log), `noise` (whitening), `candidates` and
`discrepancy` (columns of what may be missing), `evidence` (linear Gaussian algebra), `hypothesis`
(fits), `search` (a table of hypotheses), `posterior` (probabilities), `answer` (what is reported).
`always` finds what a model misses in the log it was fitted to; `floor` what noise the `best` model
found leaves, over which errors are scored. Numbers that move an answer stand in
`settings`. docs/inference.md has the equations.
"""
