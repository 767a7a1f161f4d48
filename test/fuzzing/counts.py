# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What hostile use led to."""

from collections.abc import Callable
from typing import NamedTuple

#: An answer that takes longer is a hang (s).
HANG_S = 10.0
#: Examples kept of what went wrong.
EXAMPLES = 20

#: Called with the number of cases tried.
Tell = Callable[[int], None]


class Counts(NamedTuple):
    """What came of the cases of one door; all but ``tried`` should be 0."""

    tried: int
    tracebacks: int
    hangs: int
    wrong: int  #: a wrong result given as a good one
    examples: tuple[str, ...] = ()  #: the first cases that count in one of the three, in words

    @property
    def clean(self) -> bool:
        """Whether nothing went wrong."""
        return not (self.tracebacks or self.hangs or self.wrong)


class Counter:
    """Collects the outcomes of cases; what there is of them is known at any time."""

    def __init__(self, tell: Tell) -> None:
        self._tell = tell
        self._tried, self._bad = 0, {'tracebacks': 0, 'hangs': 0, 'wrong': 0}
        self._examples: list[str] = []

    def add(self, case: str, outcome: str = '', why: str = '') -> None:
        """Count a case.

        Parameters
        ----------
        case : str
            How to do it again, in words.
        outcome : str
            Empty if it was answered well, else 'tracebacks', 'hangs' or 'wrong'.
        why : str
            What happened.
        """
        self._tried += 1
        if outcome:
            self._bad[outcome] += 1
            if len(self._examples) < EXAMPLES:
                self._examples.append(f'{outcome}: {case}: {why}'[:1000])
        self._tell(self._tried)

    def result(self) -> Counts:
        """What came of all."""
        return Counts(self._tried, **self._bad, examples=tuple(self._examples))
