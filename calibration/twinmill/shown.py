# SPDX-License-Identifier: Apache-2.0
"""Base classes of the library's objects: how they are shown, and what they are made with."""

import html
import shutil
from io import StringIO
from pathlib import Path
from typing import Any, Self

import pandas as pd
from rich.console import RenderableType

from twinmill import report
from twinmill.arguments import checked
from twinmill.files import check_report, plain
from twinmill.terminal import PlainConsole
from twinmill.version import __version__

WIDEST_COLUMNS = 100  # of a printed result; text in longer lines is hard to read
A_PATH = "the path of a file"


class Shown:
    """A result: one line, a table for notebooks, text for terminals, JSON.

    Attributes:
        left_out: sentences on robots and logs that could not be judged, and on what else is odd.
        input: what is wrong with the logs, as JSON has it; None where no log was judged.
    """

    _result: Any
    left_out: tuple[str, ...] = ()
    input: tuple[dict[str, Any], ...] | None = None

    def to_json(self) -> dict[str, Any]:
        """All numbers and names, as the command's JSON without how it was called.

        Returns:
            As the page Files tells; an absent number is None, so that JSON can hold all of it.

        Examples:
            >>> found.to_json()["score"] == found.score
            True
        """
        told = {} if self.input is None else {"input": self.input}
        found: dict[str, Any] = plain({**self._result.to_json(), **told})
        return found

    def table(self) -> pd.DataFrame:
        """The numbers; each class says which."""
        raise NotImplementedError

    def _above(self) -> tuple[str, ...]:
        """Sentences that stand above the text."""
        return self.left_out

    def _text(self) -> RenderableType:
        return repr(self)

    def __str__(self) -> str:
        out = StringIO()
        lines = [f"! {said}" for said in self._above()]
        width = min(shutil.get_terminal_size().columns, WIDEST_COLUMNS)
        PlainConsole(file=out, width=width, color_system=None).print(
            *lines, self._text(), sep="\n", highlight=False
        )
        return "\n".join(map(str.rstrip, out.getvalue().splitlines())).rstrip()

    def __copy__(self) -> Self:
        return self  # it never changes

    def __deepcopy__(self, _: dict[int, Any]) -> Self:
        return self

    def _repr_html_(self) -> str:
        return f"<p><b>{html.escape(repr(self))}</b></p>{self.table()._repr_html_()}"


class Reported(Shown):
    """A result with a page of its own."""

    def _page(self) -> tuple[report.Section, str]:
        """Section of the page, and the call that made it."""
        raise NotImplementedError

    def report(self, folder: str | Path) -> Path:
        """Writes a page with all tables and figures, as `--out` does.

        Args:
            folder: made if it is not there; an older page in it is replaced.

        Returns:
            Path of the page, folder/index.html.

        Raises:
            ValueError: the folder cannot be written.

        Examples:
            >>> from tempfile import mkdtemp
            >>> found.report(mkdtemp()).name
            'index.html'
        """
        place = path_of("folder", folder, "the path of a folder")
        check_report(place)
        section, call = self._page()
        source = report.Provenance(call, f"twinmill {__version__}", "")
        return report.write_report(place, section.title, source, [section])


def path_of(name: str, path: Any, wanted: str) -> Path:
    """A path that is none by accident: an empty text would be the working directory."""
    if not str(checked(name, path, (str, Path), wanted)):
        raise ValueError(f"{name}: is empty, and must be {wanted}.")
    return Path(path)
