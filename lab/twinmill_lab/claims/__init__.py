# SPDX-License-Identifier: Apache-2.0
"""Published claims about these swarms, run again beside an independent program's numbers.

The claims are those of Vega et al. 2024 (arXiv 2410.16444). The reference is a C program of nothing
but their equations, 100 seeds a cell unless said; "mills" there is circliness below 0.2 over the
last 10 of 120 s, started in a square of 1.2 m.
"""
