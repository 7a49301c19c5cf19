"""Completion in the shell: the Tab key knows commands, generated options, stages and formats."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest


def completed(line: str, shell: str = "bash") -> list[str]:
    """What the program answers to a shell that completes a line."""
    words = line.split(" ")
    asked = {
        "bash": {"COMP_WORDS": "\n".join(words), "COMP_CWORD": str(len(words) - 1)},
        "zsh": {"_TYPER_COMPLETE_ARGS": line},
    }[shell]
    environment = os.environ | asked | {"_SKELGEN_COMPLETE": f"complete_{shell}"}
    command = [sys.executable, "-m", "skelgen"]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=True)
    return done.stdout.split("\n")[:-1]


@pytest.mark.parametrize(
    ("line", "answer"),
    [
        ("skelgen mot", ["motion-capture"]),
        ("skelgen run --n-m", ["--n-markers"]),
        ("skelgen limbs --flex", ["--flexibility"]),
        ("skelgen run take.c3d --until s", ["skeleton"]),
        ("skelgen info --format trc", ["trc"]),
    ],
)
def test_bash_completes(line, answer):
    assert completed(line) == answer


def test_zsh_is_told_what_an_option_does():
    [answer] = completed("skelgen run --n-m", "zsh")
    assert "--n-markers" in answer
    assert "Number of physical markers" in answer


def test_script_for_the_shell_is_shown():
    # The program asks which shell started it: one of ours, as those above the tests may be none, or none it knows.
    command = ["bash", "-c", '"$0" -m skelgen --show-completion; exit $?', sys.executable]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "_SKELGEN_COMPLETE=complete_bash" in done.stdout
