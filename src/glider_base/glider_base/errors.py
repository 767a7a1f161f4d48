# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What a person reads of an error: short, printable, whatever a file or an option holds.

And how a process ends: its exit code, and the last words of a node that gives up.
"""

import os
import re
import reprlib
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from traceback import extract_tb
from typing import Any

#: Lines that an error has at most, but for one that says how many more there are.
MAX_LINES = 20
#: Characters of a line of an error; what is longer loses its middle.
MAX_LINE = 900
#: Characters of a value in an error.
MAX_SHOWN = 80
#: So many of the fields that were changed are shown with what is wrong.
CHANGES_SHOWN = 4

#: The machine or the result is to blame: a full disk, a failed flight, a vehicle that is lost,
#: something that differs.
EXIT_FAILED = 1
#: What was asked for cannot be done: an option, a file, a parameter.
EXIT_USAGE = 2
#: A node: a peer is missing, late or wrong.
EXIT_PEER = 3
#: A flight: the guard ended the mission.
EXIT_SURFACED = 3
#: Stopped by SIGINT.
EXIT_INTERRUPTED = 130

#: What the last words of a node begin with, on standard error.
FATAL = 'fatal: '
#: Program of a node in a command line: its executable, or its module.
_NODE = re.compile(r'\bglider_\w+(/|\.nodes\.)\w+$')


def leave(number: int, frame: Any) -> None:
    """Take SIGINT in a node that still imports, where an exception might be caught."""
    os._exit(0)


def leave_while_importing() -> None:
    """Have SIGINT taken by `leave`, if this is a node: its imports take a second."""
    is_node = any(_NODE.search(word) for word in sys.orig_argv[1:3])
    if is_node and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, leave)


class ConfigurationError(ValueError):
    """A file, field or option that cannot be used. The message is meant for the person.

    However long or odd what it quotes, it has few lines, each of bounded length and printable.
    """

    def __init__(self, message: str) -> None:
        lines = message.split('\n')
        if len(lines) > MAX_LINES + 1:
            lines = [*lines[:MAX_LINES], f'and {len(lines) - MAX_LINES} more']
        super().__init__('\n'.join(_clipped(printable(_clipped(line))) for line in lines))


def _clipped(line: str) -> str:
    end = MAX_LINE // 3
    return line if len(line) <= MAX_LINE else f'{line[: MAX_LINE - end - 1]}…{line[-end:]}'


def printable(text: str, keep: str = '') -> str:
    """The same text with what is not printable escaped, but for the characters to ``keep``."""
    if text.isprintable():
        return text
    return ''.join(
        one if one.isprintable() or one in keep else one.encode('unicode_escape').decode()
        for one in text
    )


class _Short(reprlib.Repr):
    """`repr` of a value that takes no longer however large it is."""

    def __init__(self) -> None:
        super().__init__()
        self.maxstring = self.maxother = MAX_SHOWN

    def repr_int(self, x: int, level: int) -> str:
        """Digits of a number; only how long it is if nobody would read them."""
        digits = int(x.bit_length() * 0.30103) + 1
        return repr(x) if digits < MAX_SHOWN else f'(a number of about {digits} digits)'


def shown(value) -> str:
    """`repr` of a value in at most `MAX_SHOWN` characters."""
    return clipped(_Short().repr(value))


def clipped(text: str) -> str:
    """The first `MAX_SHOWN` characters of a text."""
    return text if len(text) <= MAX_SHOWN else f'{text[: MAX_SHOWN - 1]}…'


def changes_text(changes: dict[str, Any]) -> str:
    """The first fields that were changed since a file was read, in words."""
    fields = [f'{clipped(field)}={shown(value)}' for field, value in changes.items()]
    more = [f'{len(fields) - CHANGES_SHOWN} more'] if len(fields) > CHANGES_SHOWN else []
    return ' with ' + ', '.join(fields[:CHANGES_SHOWN] + more) if fields else ''


def said_by(error: BaseException, calls: int = 1) -> str:
    """What code that may not be ours has raised, and where, so many calls from here, in words."""
    frames = extract_tb(error.__traceback__)[calls : calls + 1]
    where = ''.join(f'{at.filename}, line {at.lineno}: ' for at in frames)
    return f'{where}{type(error).__name__}: {error}'


@contextmanager
def installed(library: str) -> Iterator[None]:
    """Say of a library that is imported here, and is not there, how to get it.

    Raises ConfigurationError.
    """
    try:
        yield
    except ImportError:
        raise ConfigurationError(
            f'{library}, is not installed; install it with: '
            './glider python -m pip install --no-deps -r requirements-flights.txt'
        ) from None


def say_fatal(reason: object) -> None:
    """Last words of a node."""
    print(f'{FATAL}{reason}', file=sys.stderr, flush=True)
