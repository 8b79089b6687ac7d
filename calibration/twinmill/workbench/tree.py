# SPDX-License-Identifier: Apache-2.0
"""Models tried: a tree whose every model comes from its parent by one command, with undo and redo.

A model's text is what its command writes, byte for byte. Its default file name stands in the
commands until it is saved under another.
"""

import hashlib
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import tomlkit
import twinmill_native as native

from twinmill.model.model_file import ModelFile
from twinmill.model.set_values import with_values


@dataclass(frozen=True)
class Tried:
    """One model.

    Attributes:
        number: its place in the tree.
        parent: number of the model that it comes from; None of the one that was given.
        verb: words of the command that makes it, without models: `twin add coasting run.lcmlog`.
        label: short, for people.
        text: of its file.
        values: set by hand, by name.
    """

    number: int
    parent: int | None
    verb: tuple[str, ...]
    label: str
    text: str
    values: Mapping[str, float] = field(default_factory=dict)


@dataclass
class Score:
    """Score of one model on the logs.

    Attributes:
        fitted: on all data, as `compare` says it.
        heldout: each part predicted by a fit to the others; None where nobody knows: by hand, or by
            a fit elsewhere to these very logs.
        exact: false while only the clocks of the model before are known.
    """

    fitted: float
    heldout: float | None = None
    exact: bool = False


class Tree:
    """All models tried, and where one stands among them.

    Args:
        given: file of the first model, as it was called for.
    """

    def __init__(self, given: ModelFile, name: str) -> None:
        self.name = name
        self.tried = [Tried(0, None, (), "as given", given.text)]
        self.scores: dict[int, Score] = {}
        self._past, self._place = [0], 0

    # -- where one stands -----------------------------------------------------------------------

    @property
    def current(self) -> Tried:
        """The model shown."""
        return self.tried[self._past[self._place]]

    @property
    def can_undo(self) -> bool:
        """True if there was a model before."""
        return self._place > 0

    @property
    def can_redo(self) -> bool:
        """True if undo left one behind."""
        return self._place < len(self._past) - 1

    def undo(self) -> None:
        """To the model before, if there is one."""
        self._place = max(self._place - 1, 0)

    def redo(self) -> None:
        """Takes an undo back."""
        self._place = min(self._place + 1, len(self._past) - 1)

    def go(self, number: int) -> None:
        """To any model; undo leads back."""
        if number != self.current.number:
            self._past = [*self._past[: self._place + 1], number]
            self._place += 1

    # -- growing --------------------------------------------------------------------------------

    def add(self, parent: int, verb: Sequence[str], label: str, text: str) -> Tried:
        """A model that a command made of another."""
        return self._grow(Tried(len(self.tried), parent, tuple(verb), label, text))

    def set(self, values: Mapping[str, float]) -> Tried:
        """The current model with values set by hand.

        One after another they are one command, of the model that no hand has changed.
        """
        of = self.current
        parent = self.tried[of.parent] if of.values else of
        values = {name: float(f"{v:.6g}") for name, v in {**of.values, **values}.items()}
        verb = ("twin", "set", *(f"{name}={value:.6g}" for name, value in values.items()))
        number = len(self.tried)
        command = self._command(verb, self.file_name(parent.number), self.file_name(number))
        text = with_values(self.model_file(parent.number), values, command)
        names = ", ".join(f"{n.split('.', 1)[1]} {v:.4g}" for n, v in values.items())
        return self._grow(Tried(number, parent.number, verb, names, text, values))

    def _grow(self, tried: Tried) -> Tried:
        self.tried.append(tried)
        self.go(tried.number)
        return tried

    # -- files and commands ---------------------------------------------------------------------

    def file_name(self, number: int) -> str:
        """Default name of a model's file, until it is saved under another."""
        return self.name if number == 0 else f"{Path(self.name).stem}-{number}.toml"

    def model_file(self, number: int) -> ModelFile:
        """The model as its file would be read."""
        name, text = self.file_name(number), self.tried[number].text
        return ModelFile(Path(name), text, native.Model.from_toml(text, name))

    def command(self, number: int) -> str:
        """That makes a model of its parent, under their default names."""
        tried = self.tried[number]
        return self._command(tried.verb, self.file_name(tried.parent), self.file_name(number))

    def command_to_come(self, parent: int, verb: Sequence[str]) -> str:
        """That makes the next model."""
        return self._command(verb, self.file_name(parent), self.file_name(len(self.tried)))

    @staticmethod
    def _command(verb: Sequence[str], model: str, out: str) -> str:
        return shlex.join(["twinmill", *verb, "--model", model, "-o", out])

    def written(self, number: int, out: str) -> tuple[list[str], str]:
        """Commands that make a model from the one given, the last into `out`; its text then."""
        chain = [self.tried[number]]
        while chain[-1].parent is not None:
            chain.append(self.tried[chain[-1].parent])
        commands, model, text = [], self.name, self.tried[0].text
        for tried in chain[-2::-1]:
            name = out if tried.number == number else self.file_name(tried.number)
            commands.append(self._command(tried.verb, model, name))
            document = tomlkit.parse(tried.text)
            document["parent"] = hashlib.sha256(text.encode()).hexdigest()
            document["created_by"] = commands[-1]
            model, text = name, tomlkit.dumps(document)
        return commands, text

    # -- state ----------------------------------------------------------------------------------

    def to_json(self) -> dict:
        """All of it, as `restore` reads it."""
        return {
            "name": self.name,
            "tried": [asdict(t) for t in self.tried],
            "scores": {str(k): vars(s) for k, s in self.scores.items()},
            "past": self._past,
            "place": self._place,
        }

    def restore(self, data: Mapping) -> None:
        """Restores the tree from `to_json`."""
        self.tried = [Tried(**{**t, "verb": tuple(t["verb"])}) for t in data["tried"]]
        self.scores = {int(k): Score(**s) for k, s in data["scores"].items()}
        self._past, self._place = list(data["past"]), int(data["place"])
