"""Calling commands in this process."""

import pytest

from mdstopo.cli.group import run_group


def call(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    """The exit status of a command, and what it prints: output, messages."""
    status = run_group(list(words))
    said = capsys.readouterr()
    return status, said.out, said.err
