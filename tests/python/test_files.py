# SPDX-License-Identifier: Apache-2.0
"""Outputs appear whole or not at all, and a place that cannot be written is told in a sentence."""

import errno

import pytest

from twinmill.files import replacing, replacing_folder
from twinmill_cli import main

FULL = OSError(errno.ENOSPC, "No space left on device")


def test_a_new_folder_comes_with_those_above_it(tmp_path):
    with replacing_folder(tmp_path / "a" / "b" / "c", force=False) as folder:
        folder.mkdir()
        (folder / "one").write_text("1")
    assert [p.name for p in sorted(tmp_path.rglob("*"))] == ["a", "b", "c", "one"]


@pytest.mark.parametrize("made", [replacing, replacing_folder])
def test_on_a_full_disk_a_sentence_is_all_that_is_left(made, tmp_path):
    out = tmp_path / "c" if made is replacing else tmp_path / "a" / "b" / "c"
    sentence = rf"{out}: cannot be written \(No space left on device\)"
    with pytest.raises(ValueError, match=sentence), made(out, force=False):
        raise FULL
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_is_named(tmp_path):
    absent = tmp_path / "a"
    refused(rf"there is no folder {absent}; make the folder", replacing, absent / "b.toml")
    (tmp_path / "file").write_text("")
    for made in (replacing, replacing_folder):
        refused(rf"{tmp_path / 'file'} is a file", made, tmp_path / "file" / "b")


def refused(sentence, made, out) -> None:
    with pytest.raises(ValueError, match=sentence), made(out, force=False):
        pass


def test_no_command_ends_with_the_number_of_an_error(monkeypatch, capsys, tmp_path):
    def fail(_):
        (tmp_path / "absent").read_text()

    monkeypatch.setattr(main, "run", fail)
    with pytest.raises(SystemExit) as left:
        main.main()
    assert left.value.code == 1
    assert capsys.readouterr().err == f"twinmill: {tmp_path}/absent: No such file or directory.\n"
