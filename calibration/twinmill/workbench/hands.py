# SPDX-License-Identifier: Apache-2.0
"""What a panel may ask of the page that it is on."""

from typing import Protocol

from twinmill.workbench.bench import Bench


class Hands(Protocol):
    """The page.

    Attributes:
        bench: what all pages show.
    """

    bench: Bench

    async def start(self, kind: str, effect: str = "", options: dict | None = None) -> None:
        """A fit, an addition, a diagnosis, a next run or a swarm."""

    async def design(self) -> None:
        """Designs the run that parts what cannot be parted, in its panel."""

    async def try_beside(self, effect: str) -> None:
        """Draws what an effect would change beside the model; once more takes it away."""

    async def keep(self, name: str, value: float) -> None:
        """A knob was let go at a value."""

    async def go(self, number: int) -> None:
        """To a model tried before."""

    def javascript(self, code: str) -> None:
        """Runs in this page's browser."""
