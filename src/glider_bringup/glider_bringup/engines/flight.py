# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""One flight by the direct engine: its rows go to whoever takes them. Nothing of ROS is needed."""

import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol

import numpy as np
from numba import typeof

from glider_base.settings import ConfigurationError
from glider_base.signals import AT_TICK, Battery, at_tick, raised
from glider_base.wiring import WHEN_SILENT
from glider_bringup.engines.direct import (
    FlightError,
    HeldMission,
    MissionParams,
    MissionState,
    blocks_of,
)
from glider_bringup.engines.interrupts import interrupts_noted
from glider_guidance.guidance import guidance_abort
from glider_guidance.order import Order
from glider_guidance.orders import (
    begins,
    changed,
    check_orders,
    due,
    is_surfaced,
    judged_end,
    reaction,
    ticks_alone,
    to_end,
    wait_for_surface,
)
from glider_guidance.status import Status, status_of
from glider_guidance.yo.stage import AT_END_OF_PATH
from glider_mission.blocks import COLUMNS, ROW
from glider_mission.disk import VANISHED, DiskError
from glider_mission.routing.pilot import LOOK_TICKS, Pilot
from glider_mission.scenario import Scenario

_STAGE, _NO_PROGRESS = COLUMNS['stage'], COLUMNS['no_progress']
_ODOM, _BATTERY = COLUMNS['odom'], COLUMNS['battery']

#: Rows that sinks are given at a time: a quarter of an hour, which a processor's cache may hold.
TAKEN_TICKS = 9000

#: Called now and then with the ticks flown and the depth (m).
Progress = Callable[[int, float], None]


class Outcome(NamedTuple):
    """How a flight ended, apart from what its topics tell."""

    status: str  #: completed, aborted, or failed: it could not go on
    reason: str  #: why it was aborted, or failed
    wall_time_s: float | None  #: None if nobody measured it
    messages_recorded: int = 0
    messages_lost: int = 0
    orders: tuple[Order, ...] = ()  #: that were given by who planned the route


class Sink(Protocol):
    """What follows a flight: a score, traces, a bag.

    One that has a method ``order`` is given the orders that come in flight, before their rows;
    one that has a method ``follow`` the ticks from which orders hold, with these, in their order.
    """

    def add(self, log: np.ndarray) -> None:
        """Take in the next rows, float64[n, ROW]; they are valid until the next are flown."""


def _shapes(values: Any) -> Any:
    """Shapes of what a state holds, of which its type says nothing; no kernel checks an index."""
    return tuple(map(_shapes, values)) if isinstance(values, tuple) else np.shape(values)


def mission_of(scenario: Scenario) -> tuple[MissionState, MissionParams]:
    """State at tick 0 and parameters of the six blocks."""
    blocks = scenario.block_settings()
    state = MissionState(*(block.initial_state() for block in blocks))
    return state, MissionParams(*(block.params() for block in blocks))


@dataclass
class Past:
    """What a mission was ordered, and has reported, until now."""

    waiting: tuple[Order, ...]  #: those to come
    tick: int = 0  #: ticks flown
    stage: int = -1  #: of guidance, at the last one; -1: there was none
    no_progress: int = 0  #: what guidance reported of that then
    arrived: bool = False  #: it is at the end of its path, and was near enough to its last point
    battery: Battery = Battery(*WHEN_SILENT['battery'])  #: what it said then
    own: tuple[Order, ...] = ()  #: what it orders itself by that, to come
    #: what held until now, and whether it was given
    followed: tuple[tuple[Order, bool], ...] = ()


class Kept(NamedTuple):
    """A mission between two ticks; a value, which can be pickled."""

    mission: MissionState
    past: Past


class Held:
    """A mission between two ticks, where compiled code finds it, and the orders that it follows.

    ``mission`` is flown instead of `mission_of` the scenario; the sinks that ``follow`` orders
    are given them, and those that take an ``order`` of what a ``pilot`` gives.
    """

    def __init__(
        self,
        scenario: Scenario,
        mission: tuple[MissionState, MissionParams] | None = None,
        sinks: Iterable[Sink] = (),
        pilot: Pilot | None = None,
    ) -> None:
        state, self._params = mission or mission_of(scenario)
        self._held = HeldMission(state, self._params)
        self._scenario, self._settings = scenario, scenario.guidance_settings()
        self.past = Past(tuple(scenario.orders))
        self._pilot, self._row = pilot, None
        self._followers = [sink for sink in sinks if hasattr(sink, 'follow')]
        self._hearers = [sink for sink in sinks if hasattr(sink, 'order')]
        self._held.fly(np.empty((0, ROW)))

    def keep(self) -> Kept:
        """All that it is at this moment."""
        return Kept(self._held.state, replace(self.past))

    @property
    def status(self) -> Status:
        """How the mission goes, by guidance."""
        return status_of(self._held.state.guidance, self._settings.params(), self.past.battery)

    def restore(self, kept: Kept) -> None:
        """Go on from there.

        Raises ConfigurationError if it is of a mission with another law, other blocks, or more or
        fewer faults or parts of the current, or its orders make no sense.
        """
        state, own = kept.mission, self._held.state
        if typeof(state) != typeof(own) or _shapes(state) != _shapes(own):
            raise ConfigurationError(
                'state: of another flight (allowed: of the same scenario and the same law)'
            )
        self._tell(kept.past.followed)
        self._held.state = kept.mission
        self.past = replace(kept.past)

    def order(self, order: Order) -> None:
        """Take an order in.

        Raises ConfigurationError if it makes no sense, now or with those to come.
        """
        if self._held.state.guidance.profile.aborted:
            raise ConfigurationError('the mission is aborted (allowed: nothing more)')
        waiting = (*self.past.waiting, order)
        check_orders(self._settings, waiting, '')
        self.past.waiting = waiting

    def fly(self, log: np.ndarray) -> tuple[int, bool]:
        """Fill a log, float64[n, ROW]; rows filled, and whether the mission has ended."""
        filled, is_over = 0, False
        while filled < len(log) and not is_over:
            if self._pilot and self.past.tick % LOOK_TICKS == 0:
                if order := self._pilot.order(self.past.tick, self._row):
                    for one in (self, *self._hearers):
                        one.order(order)
            orders = due((*self.past.waiting, *self.past.own), self.past.tick, self.past.stage)
            for follower in self._followers if orders else ():
                follower.follow(self.past.tick, orders)
            for order in orders:
                self._follow(order)
            self.past.own = ()
            alone = ticks_alone(self.past.waiting, self.past.tick)
            look = LOOK_TICKS - self.past.tick % LOOK_TICKS if self._pilot else math.inf
            ticks = int(min(len(log) - filled, alone, look))
            try:
                flown, is_over = self._until_ordered(log[filled : filled + ticks])
            except FlightError:
                if filled:  # it will be raised once more, of no rows
                    break
                raise
            filled += flown
            self.past.tick += flown
            self._look(log[filled - flown : filled])
        return filled, is_over

    def _until_ordered(self, log: np.ndarray) -> tuple[int, bool]:
        """Fill a log, but not beyond where an order waits for the surface, or is a reaction."""
        waits = wait_for_surface(self.past.waiting, self.past.tick)
        reacts = self._settings.no_progress != 'tell'
        drifts = self.past.stage == AT_END_OF_PATH  # and may miss it; it halts where that begins
        if len(log) == 1 or not (waits or reacts or drifts):
            return self._until_raised(log)
        before = self._held.state
        rows, is_over = self._until_raised(log)
        up = np.flatnonzero(is_surfaced(log[:rows, _STAGE])) if waits else ()
        stays = begins(log[:rows, _NO_PROGRESS], self.past.no_progress) if reacts else ()
        astray = np.flatnonzero(self._judged_end(log[:rows])[0])
        last = min((int(at[0]) + 1 for at in (up, stays, astray) if len(at)), default=rows)
        if last < rows:  # again, and no further
            self._held.state = before
            rows, is_over = self._held.fly(log[:last])
        return rows, is_over

    def _until_raised(self, log: np.ndarray) -> tuple[int, bool]:
        """Fill a log, or a part of it, if a law raises in the rest; a FlightError, if at once."""
        try:
            return self._held.fly(log, halts=True)
        except Exception as error:
            if len(log) > 1:
                return self._until_raised(log[: len(log) // 2])
            raise FlightError(at_tick(raised(error), self.past.tick)) from error

    def _judged_end(self, log: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return judged_end(self._settings, log[:, _STAGE], log[:, _ODOM], self.past.arrived)

    def _look(self, log: np.ndarray) -> None:
        """Note what guidance and battery reported at the last tick, and what it orders itself."""
        self._row = row = log[-1].copy()
        before = int(log[-2, _NO_PROGRESS]) if len(log) > 1 else self.past.no_progress
        self.past.no_progress = int(row[_NO_PROGRESS])
        self.past.stage, self.past.battery = int(row[_STAGE]), Battery(*row[_BATTERY].tolist())
        if self.past.no_progress and not before:
            order = reaction(self._settings, self.past.no_progress, row[_ODOM], self.past.tick)
            self.past.own = (order,) if order else ()
        misses, arrived = self._judged_end(log)
        self.past.arrived = bool(arrived[-1])
        if misses[-1]:
            order = to_end(self._settings, row[_ODOM], self.past.tick)
            self.past.own = (order,) if order else ()

    def _follow(self, order: Order) -> None:
        """Do what an order says."""
        self.past.waiting = tuple(one for one in self.past.waiting if one is not order)
        if order.abort:
            self.past.waiting = ()
            state = self._held.state
            self._held.state = state._replace(guidance=guidance_abort(state.guidance))
            return
        given = not any(one is order for one in self.past.own)
        try:
            self._tell((*self.past.followed, (order, given)))
        except ConfigurationError:  # it made sense before guidance ordered itself something
            return

    def _tell(self, followed: tuple[tuple[Order, bool], ...]) -> None:
        """Fly on by orders that were followed."""
        if followed == self.past.followed:
            return
        settings, known = self._settings, len(self.past.followed)
        if followed[:known] != self.past.followed:  # of a state of before, or of another flight
            settings, known = self._scenario.guidance_settings(), 0
        for order, _ in followed[known:]:
            settings = changed(settings, order)
        self.past.arrived &= settings.path == self._settings.path
        self._settings, self.past.followed = settings, followed
        # who ends the run knows what was ordered from outside, as over nodes
        outside = tuple(order for order, given in followed if given)
        ends = self._scenario.with_orders(outside).plant_settings().ends()
        plant = self._params.plant._replace(**ends)
        params = self._params._replace(guidance=settings.params(), plant=plant)
        self._held.set_params(params)


def ended(complete: bool, reason: str) -> str:
    """Status of a flight that was complete, or ended early for a reason."""
    if complete:
        return 'completed'
    return 'failed' if AT_TICK in reason or VANISHED in reason else 'aborted'


def refuse_message_faults(scenario: Scenario) -> None:
    """Refuse a scenario in which messages go wrong: there are none."""
    for fault in scenario.message_faults:
        raise ConfigurationError(
            f"faults.{scenario.faults.index(fault)}.kind = '{fault.kind}': the direct engine has "
            'no messages that could go wrong (fly with --engine nodes)'
        )


def fly(
    scenario: Scenario,
    sinks: Iterable[Sink] = (),
    progress: Progress | None = None,
) -> Outcome:
    """Fly with the direct engine; Ctrl-C ends it as aborted with what was flown.

    A number that is not finite ends it as failed, with what was flown before. So does a recording
    that is gone; a disk that takes no more ends it as aborted. Each sink is given every row, in
    their order. Raises ConfigurationError if messages are to go wrong, for there are none.
    """
    refuse_message_faults(scenario)
    sinks = tuple(sinks)
    status, reason, ticks = 'completed', '', 0
    with interrupts_noted() as interrupts:
        mission = mission_of(scenario)
        pilot = Pilot(scenario) if scenario.guidance.route == 'planned' else None
        start = time.perf_counter()
        try:
            held = Held(scenario, mission, sinks, pilot)
            for log in blocks_of(held.fly, TAKEN_TICKS):
                for sink in sinks:
                    sink.add(log)
                ticks += len(log)
                if progress:
                    progress(ticks, float(-log[-1, 2]))
                if interrupts:
                    status, reason = 'aborted', f'stopped by {interrupts[0]}'
                    break
        except FlightError as error:
            status, reason = 'failed', str(error)
        except DiskError as error:
            status, reason = ended(False, str(error)), str(error)
    orders = tuple(pilot.orders) if pilot else ()
    return Outcome(status, reason, time.perf_counter() - start, orders=orders)
