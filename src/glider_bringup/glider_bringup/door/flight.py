# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A flight that anybody can hold: flown step by step, looked at, kept, and flown on."""

import math
import signal
from collections.abc import Callable, Mapping
from numbers import Integral, Real
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from glider_base.errors import shown
from glider_base.settings import ConfigurationError, validate
from glider_base.signals import TICK_S
from glider_bringup.console import compiling
from glider_bringup.door.run import chosen_scenario
from glider_bringup.engines.compiling import shown_once
from glider_bringup.engines.direct import FlightError, fault_of, finite_rows
from glider_bringup.engines.flight import Held, Kept, refuse_message_faults
from glider_bringup.engines.interrupts import interrupts_noted
from glider_bringup.scoring.scores import seconds
from glider_control.law import LawSettings
from glider_guard.rows import LATCHED
from glider_guidance.order import Order
from glider_guidance.status import Status
from glider_guidance.yo.stage import AT_END_OF_PATH
from glider_mission.blocks import COLUMNS, ROW
from glider_mission.chart import in_metres
from glider_mission.choices import combination_of
from glider_mission.planned import refuse_planned_route
from glider_mission.scenario import DEFAULT_SCENARIO, Scenario, named_in, with_known_fields

#: A vehicle that has been below the first depth and is above the second has surfaced (m).
UNDER_M, SURFACED_M = 2.0, 1.0
#: Ticks that are flown before one looks whether something has happened.
_LOOK_TICKS = 600
_DEPTH, _STAGE, _GUARD = COLUMNS['ground_truth/odom'].start + 2, COLUMNS['stage'], COLUMNS['guard']


class Event(NamedTuple):
    """Why a flight came back."""

    name: str  #: time, surfacing, arrival, guard, or end
    tick: int  #: ticks flown


class Past(NamedTuple):
    """What a flight has been up to a tick."""

    row: np.ndarray | None  #: the numbers of the last one, float64[ROW]; None: there was none
    is_under: bool  #: has been under water since it was last at the surface
    is_over: bool
    orders: tuple[Order, ...]  #: that it was given


class FlightState(NamedTuple):
    """A flight between two ticks; a value, which can be pickled."""

    kept: Kept
    past: Past


def _under(log: np.ndarray, before: bool) -> np.ndarray:
    """Whether the vehicle is under water, bool[n]; between the two depths it is where it was."""
    depth = -log[:, _DEPTH]
    known = np.where((depth > UNDER_M) | (depth < SURFACED_M), np.arange(len(log)), -1)
    last = np.maximum.accumulate(known)
    return np.where(last >= 0, depth[last] > UNDER_M, before)


#: What a flight can be flown until, beside its end: whether it is so, in rows of a log, bool[n].
EVENTS: dict[str, Callable[[np.ndarray, bool], np.ndarray]] = {
    'surfacing': lambda log, under: ~_under(log, under),
    'arrival': lambda log, under: log[:, _STAGE] == AT_END_OF_PATH,
    'guard': lambda log, under: (log[:, _GUARD].astype(np.int64) & LATCHED) != 0,
}


def _begins(event: str, log: np.ndarray, past: Past) -> np.ndarray:
    """Rows of a log in which something begins, int[n]; what is so from the first tick does not."""
    holds = EVENTS[event](log, past.is_under)
    first = log[:1] if past.row is None else past.row[None]
    before = np.concatenate([EVENTS[event](first, past.is_under), holds[:-1]])
    return np.flatnonzero(holds & ~before)


class Flight:
    """A flight by the direct engine, in one's own hands.

    Parameters
    ----------
    scenario, set, controller, law, guidance, seed, duration
        As of `glider_bringup.fly`.

    Raises
    ------
    ConfigurationError
        Naming field, value and allowed range.

    Examples
    --------
    >>> flight = Flight('current_8deg', seed=7)
    >>> flight.until('surfacing', t_s=3600.0)
    Event(name='time', tick=36000)
    >>> flight.now['ground_truth_odom_depth']
    """

    def __init__(
        self,
        scenario: str | Path | Scenario = DEFAULT_SCENARIO,
        set: Mapping[str, Any] | None = None,
        *,
        controller: str | None = None,
        law: type[LawSettings] | Callable | None = None,
        guidance: str | None = None,
        seed: int | None = None,
        duration: float | str | None = None,
    ) -> None:
        self.scenario = chosen_scenario(scenario, set, controller, law, guidance, seed, duration)
        refuse_message_faults(self.scenario)
        refuse_planned_route(self.scenario)
        self._log = np.empty((_LOOK_TICKS, ROW))
        with shown_once(combination_of(self.scenario), compiling):
            self._held = Held(self.scenario)
        self._past = Past(None, False, False, tuple(self.scenario.orders))

    @property
    def tick(self) -> int:
        """Ticks flown."""
        return self._held.past.tick

    @property
    def t_s(self) -> float:
        """Time flown (s)."""
        return seconds(self.tick)

    @property
    def is_over(self) -> bool:
        """Whether the mission has ended: nothing can be flown any more."""
        return self._past.is_over

    @property
    def state(self) -> FlightState:
        """All that the flight is at this moment, to be kept, pickled and restored."""
        return FlightState(self._held.keep(), self._past)

    def __reduce__(self):
        raise TypeError(
            'a Flight lies in compiled memory and is not copied: keep its state, and restore that '
            'in another Flight of the same scenario'
        )

    def restore(self, state: FlightState) -> 'Flight':
        """Go on from a state, of this flight or of another one of the same scenario.

        One with another law, method or navigation, or with more or fewer faults or parts of the
        current, is refused. Whether numbers of the scenario are
        others is not known: the parameters are those of this flight, changed by the orders that
        the state has.
        """
        if not isinstance(state, FlightState):
            raise ConfigurationError(
                f'state = {shown(state)}: not usable (allowed: what Flight.state gave)'
            )
        self._held.restore(state.kept)
        self._past = state.past
        return self

    @property
    def now(self) -> dict[str, Any]:
        """Every number of the last tick, by the names of `Run.to_xarray`: NED, FRD, SI, radians.

        What is true is ``ground_truth_odom_...``, what is estimated ``odom_...``. Empty before the
        first tick.
        """
        from glider_bringup.door.dataset import numbers_of

        return {} if self._past.row is None else numbers_of(self._past.row, self.scenario)

    @property
    def status(self) -> Status:
        """How the mission goes, as ``mission/status`` tells it over nodes."""
        return self._held.status

    def step(self, n: int = 1) -> Event:
        """Fly ``n`` ticks of 0.1 s, or until the mission ends; raises as `until`."""
        if not isinstance(n, Integral) or n < 1:
            raise ConfigurationError(f'n = {shown(n)}: not usable (allowed: ticks, 1 and more)')
        return self._fly(self.tick + int(n), 'end')

    def until(self, event: str = 'end', *, t_s: float = math.inf) -> Event:
        """Fly until something happens, a time since the start (s) has come, or the mission ends.

        Parameters
        ----------
        event : str
            ``'surfacing'``: the vehicle, which has been deeper than 2 m, is shallower than 1 m.
            ``'arrival'``: it is at the end of its path. ``'guard'``: the guard sends it up, or
            lets its weight go. ``'end'``: only the end of the mission.
        t_s : float

        Returns
        -------
        Event
            What it was, and how many ticks have been flown. The tick at which it happens is flown.

        Raises
        ------
        FlightError
            Where a number is none any more, with its name and tick, or a law raises; the flight
            is over then, and stands where all was well.
        """
        if event not in (*EVENTS, 'end'):
            allowed = ', '.join((*EVENTS, 'end'))
            raise ConfigurationError(f'event = {shown(event)}: unknown (allowed: {allowed})')
        if not isinstance(t_s, Real) or not t_s > -math.inf:
            raise ConfigurationError(f't_s = {shown(t_s)}: not usable (allowed: seconds, or inf)')
        return self._fly(round(min(float(t_s), 1e9) / TICK_S), event)  # no flight is so long

    def order(self, **asked: Any) -> Order:
        """Tell the vehicle something, from the next tick on.

        Parameters
        ----------
        path : mapping or PathSettings, optional
            Another path, as in a scenario; it is entered at its nearest point.
        depth_m, pitch_deg, wait_s : float, optional
            Another depth of the lower turn, from this dive on, another pitch of the glides (deg),
            another wait on the surface between dives (s).
        when : str
            Of these four: ``'once'``, or ``'surfacing'``: when the vehicle is at the surface.
        hold, resume, abort : bool
            Come up and wait at the surface, dive on, or come up for good.

        Returns
        -------
        Order
            What was ordered, and when.

        Raises
        ------
        ConfigurationError
            Naming what makes no sense, and why. Nothing has changed then.

        Examples
        --------
        >>> flight.order(depth_m=300.0, when='surfacing')
        >>> flight.order(hold=True)
        """
        if 'at_s' in asked:
            raise ConfigurationError(
                'order: at_s: it holds from the next tick on, or as when says'
            )
        try:
            path = in_metres(asked.get('path'), self.scenario.origin)
        except ValueError as error:
            raise ConfigurationError(f'order: path: {error}') from None
        asked = {**asked, 'path': path, 'at_s': round(self.t_s, 1)}
        order = validate(Order, asked, 'order')
        if self._past.is_over:
            raise ConfigurationError('order: the mission is over (allowed: before its end)')
        with named_in('order: '):
            if order.path:
                with_known_fields(self.scenario.model_copy(update={'orders': [order]}))
            self._held.order(order)
        self._past = self._past._replace(orders=(*self._past.orders, order))
        return order

    @property
    def orders(self) -> list[dict[str, Any]]:
        """All orders so far, as in ``orders`` of a scenario, which either engine flies again."""
        return [
            order.model_dump(mode='json', exclude_defaults=True) for order in self._past.orders
        ]

    def _fly(self, last_tick: float, event: str) -> Event:
        while not self._past.is_over and self.tick < last_tick:
            ticks = int(min(_LOOK_TICKS, last_tick - self.tick))
            with interrupts_noted() as noted:  # one in between would leave it torn
                fault, happened = self._look(ticks, event)
            if noted:
                signal.raise_signal(signal.Signals[noted[0]])
            if happened:
                return Event(event, self.tick)
            if fault:
                raise FlightError(fault)
        return Event('end' if self._past.is_over else 'time', self.tick)

    def _look(self, ticks: int, event: str) -> tuple[str, bool]:
        """Fly some ticks, or to where it happens: what is not finite, and whether it happened."""
        before = self.state if event in EVENTS else None
        log, fault = self._advance(ticks)
        if before and len(begins := _begins(event, log, before.past)):
            if fault or begins[0] + 1 < len(log):  # again, and no further
                self.restore(before)._advance(int(begins[0]) + 1)
            return '', True
        return fault, False

    def _advance(self, ticks: int) -> tuple[np.ndarray, str]:
        """Fly some ticks, one at least; their rows, float64[n, ROW], until one is not finite.

        Gives in words what is not, and the flight is over then.
        """
        first, past = self.tick, self._past
        fault = ''
        try:
            rows, is_over = self._held.fly(self._log[:ticks])
        except FlightError as error:
            rows, is_over, fault = 0, True, str(error)
        good = finite_rows(self._log[:rows])
        if good < rows:
            fault, is_over = fault_of(self._log[good], first + good), True
            self._held.past.tick = first + good
        log = self._log[:good]
        row, is_under = past.row, past.is_under
        if good:
            row, is_under = log[-1].copy(), bool(_under(log, is_under)[-1])
        self._past = Past(row, is_under, is_over, past.orders)
        return log, fault
