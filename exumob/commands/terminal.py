"""What goes to the terminal: texts of users, files and other programs as they are, never as commands of it."""

from __future__ import annotations

import logging
import unicodedata
from typing import Any

from rich.console import Console
from rich.highlighter import NullHighlighter
from rich.logging import RichHandler
from rich.progress import Task, TextColumn
from rich.text import Text

_HIDDEN = frozenset(("Cc", "Cf", "Cs", "Zl", "Zp"))
"""Categories of characters that act on a terminal, turn the direction of writing, or cannot be written at all."""


def visible(text: str) -> str:
    """Return a text whose characters that act on a terminal are written as Python escapes them.

    New lines and tabs stay.
    """
    if text.isascii() and text.isprintable():
        return text
    return "".join(
        character.encode("unicode_escape").decode()
        if unicodedata.category(character) in _HIDDEN and character not in "\n\t"
        else character
        for character in text
    )


class PlainConsole(Console):
    """A console that prints texts as they are: no markup, no emoji codes, no control characters."""

    def __init__(self, *, stderr: bool = False) -> None:
        """Write to the standard output, or to that of errors."""
        super().__init__(stderr=stderr, markup=False, emoji=False, highlight=False)

    def render_str(self, text: str, **options: Any) -> Text:
        """Turn a text that is printed, or stands in a table, into what is shown."""
        return super().render_str(visible(text), **options)


class PlainColumn(TextColumn):
    """A column of a progress bar whose texts are shown as they are."""

    def __init__(self, text_format: str) -> None:
        """Take a format with the fields of the task."""
        super().__init__(text_format, markup=False)

    def render(self, task: Task) -> Text:
        """Show the text of a task."""
        return Text(visible(self.text_format.format(task=task)), justify=self.justify)


class _PlainFormatter(logging.Formatter):
    def format(self, record: logging.LogRecord) -> str:
        return visible(super().format(record))


def log_handler(console: Console, show_time: bool = False) -> logging.Handler:
    """Return a handler that shows log messages as they are."""
    handler = RichHandler(
        console=console, show_time=show_time, show_path=False, markup=False, highlighter=NullHighlighter(), keywords=[]
    )
    handler.setFormatter(_PlainFormatter("%(message)s"))
    return handler
