# SPDX-License-Identifier: Apache-2.0
"""Names in formulas: the channels that they change, and on what they depend."""

STILL = (0.002, 0.002, 0.01)  # m/s, m/s, rad/s: below it an axis does not move; wheels differ
CHANNELS = ("vx_mps", "vy_mps", "omega_radps")
SPEEDS = ("vx", "vy", "omega")
COUPLING = "coupling of the axes"
CHANGE = "change of the command"
PAST = "past motion"
TIME = "time"
WAY = "way driven"
PLACE = "place"


def times(n: int, name: str) -> str:
    """So many times a name, as a formula has it."""
    return f"{n}*{name}" if n > 1 else name
