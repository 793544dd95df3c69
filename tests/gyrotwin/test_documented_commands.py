"""Every command in README and docs: its options and arguments are those of the program."""

import shlex
from pathlib import Path
from typing import Any

import pytest

from gyrotwin.cli import load_command
from tests.docs.documented import PAGES, commands

COMMANDS = sorted({(page.name, text) for page in PAGES for text in commands(page)})


def parse(text: str) -> Any:
    """The context of the innermost command, which is not run."""
    _, name, *words = shlex.split(text)
    command = load_command(name)
    context = command.make_context(name, words)
    while hasattr(command, "commands"):
        name, command, words = command.resolve_command(context, words)
        context = command.make_context(name, words, parent=context)
    return context


@pytest.mark.parametrize(("page", "text"), COMMANDS)
def test_options_and_arguments_are_there(page: str, text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Files that a command before it writes are there only for a user who types both.
    for word in shlex.split(text):
        if "/" in word or word.endswith((".toml", ".csv", ".fmu", ".py")):
            place = tmp_path / word
            place.parent.mkdir(parents=True, exist_ok=True)
            place.touch()
    monkeypatch.chdir(tmp_path)
    assert parse(text).params is not None


def test_a_mistyped_option_is_found() -> None:
    with pytest.raises(Exception, match="No such option: --sede"):
        parse("gyrotwin run constant --sede 7")


def test_there_are_commands_to_look_at() -> None:
    assert len(COMMANDS) >= 20
