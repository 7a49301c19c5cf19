"""What an error says: one line that fits a screen and tells a terminal nothing."""

from __future__ import annotations

from pathlib import Path

import pytest

from skelgen.errors import Cancelled, FormatError, InputError, SkelgenError, out_of_memory


def test_sentence_that_is_too_long_loses_its_middle():
    sentence = str(SkelgenError("a" * 5000 + "; rename it"))
    assert len(sentence) == 300
    assert sentence.startswith("aaa") and sentence.endswith("aaa; rename it") and " [...] " in sentence


def test_name_of_the_file_is_never_cut():
    path = Path("/" + "d/" * 400 + "walk.trc")
    error = FormatError(path, "line " * 100, "what " * 100)
    assert str(error).startswith(f"{path}:line ")
    assert len(str(error)) == len(f"{path}:") + 300


@pytest.mark.parametrize("foreign", ["two\nlines", "two\r\n  lines", "two\u2028lines"])
def test_error_is_one_line(foreign):
    assert str(FormatError("a", 1, foreign)) == "a:1: two lines"


def test_foreign_text_cannot_command_a_terminal():
    assert str(InputError("\x1b]0;title\x07 \ud800 Größe")) == "?]0;title? ? Größe"


def test_short_sentences_stay_as_they_are():
    assert str(FormatError("walk.csm", 4, "8 numbers where 9 belong")) == "walk.csm:4: 8 numbers where 9 belong"
    assert (str(InputError("no  frame")), str(Cancelled())) == ("no  frame", "")
    assert out_of_memory(MemoryError()).startswith("the memory of this computer does not suffice: ")
