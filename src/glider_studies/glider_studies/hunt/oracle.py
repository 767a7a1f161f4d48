# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What became of a flight, by its true motion, and whether the vehicle had the means.

Nothing here knows what the guard watches for. Whether pump and weight would have sufficed is
flown: from some tick on, the plant alone, the whole pump out, drop weight released, the mass
where it balances, at the climb stop, or there once the vehicle rises. Nobody can act on a fault
before it shows: while the flight is, to the last bit, the one without that fault.
"""

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from glider_base.kernel import kernel
from glider_base.signals import TICK_S
from glider_bringup.engines import direct
from glider_bringup.engines.direct import MissionParams, MissionState
from glider_bringup.engines.flight import fly, mission_of
from glider_guard.rows import DROPS, SURFACES
from glider_mission.blocks import COLUMNS, ROW
from glider_mission.scenario import Scenario
from glider_model.onboard.moving_mass import make_moving_mass, mass_place
from glider_model.plant.block import plant_move
from glider_model.vehicle.file import load_vehicle
from glider_studies.hunt.missions import due_s

#: At the surface is shallower than this (m); one that fills up there may sink by so much for a
#: while, until its weight goes.
AT_SURFACE_M, SINKS_AGAIN_M = 2.0, 5.0
#: Deeper than rated by this share nobody goes untold.
BELOW_RATED = 0.06
#: Nor hangs within so many metres for so long (s) under water. One that has for the second time
#: does not fly its mission, whatever its settings ask for: it is rightly sent up.
HANGS_M, HANGS_S, STANDS_S = 5.0, 7200.0, 600.0
#: A vehicle is saved if all is done for it this long (s) after the last fault has shown.
GRACE_S = 300.0
#: Ticks from one sample of the depth that is kept to the next.
_EVERY = 10
_DEPTH = COLUMNS['ground_truth/odom'].start + 2
_GUARD = COLUMNS['guard']


class Truth:
    """Takes log rows: true depth, what the guard reported, and whether every number is finite."""

    def __init__(self) -> None:
        self._depth: list[np.ndarray] = []
        self._rows: list[np.ndarray] = []
        self._ticks = 0
        self.deepest = 0.0

    def add(self, log: np.ndarray) -> None:
        """Take in a block of log rows, float64[n, ROW]."""
        first = -self._ticks % _EVERY
        self.deepest = max(self.deepest, float(-log[:, _DEPTH].min()))
        self._depth.append(-log[first::_EVERY, _DEPTH])
        self._rows.append(log[first::_EVERY, _GUARD].astype(np.int64))
        self._ticks += len(log)

    @property
    def depth(self) -> np.ndarray:
        """True depth (m) once a second."""
        return np.concatenate(self._depth)

    @property
    def rows(self) -> np.ndarray:
        """Rows that the guard reported, once a second."""
        return np.concatenate(self._rows)


class Verdict(NamedTuple):
    """What is wrong with a flight; empty: nothing."""

    kind: str  #: lost, late, untold, not_finite
    why: str


@kernel
def _rise(plant, params, water, command, mass, mode, drop, depths, dt):
    """Fill ``depths`` (float64[n]) with what the plant alone does under a command.

    ``drop`` is 1.0 if the weight is let go, else 0.0. ``mode`` says where the pitch mass is: 0 in
    balance, 1 at its climb stop, 2 there once the vehicle rises by 0.05 m/s.
    """
    before = plant.motion.p_d
    rising = mode == 1
    for i in range(len(depths)):
        level = mass_place(0.0, plant.joints.m_b, -command[1], mass)
        target = (command[0], command[1] if rising else level, 0.0, 0.0)
        plant = plant_move(plant, (target, water, (drop,)), params, dt)
        depths[i] = plant.motion.p_d
        rising = rising or (mode == 2 and before - plant.motion.p_d > 0.05 * dt)
        before = plant.motion.p_d


def _flown(scenario: Scenario, for_s: float) -> tuple[MissionState, MissionParams, np.ndarray]:
    """State, params and log (float64[ticks, ROW]) of a flight of ``for_s`` or less."""
    state, params = mission_of(scenario)
    log = np.empty((round(for_s / TICK_S), ROW))
    state, rows, _ = direct.fly(state, params, log)
    return state, params, log[:rows]


def _all_done(
    scenario: Scenario, from_s: float, for_s: float, drops: bool = True
) -> Iterator[np.ndarray]:
    """Depths (m), float64[ticks] from a time on, if all is done then: of each mode, as asked."""
    state, params, log = _flown(scenario, max(from_s, TICK_S))
    water = tuple(log[-1, COLUMNS['current_velocity']])
    vehicle = params.plant.vehicle
    command, mass = (-vehicle.m_b_max, -vehicle.x_p_max), make_moving_mass(vehicle)
    for mode in range(3):
        depths = np.empty(round(for_s / TICK_S))
        _rise(state.plant, params.plant, water, command, mass, mode, float(drops), depths, TICK_S)
        yield depths


def _comes_up(depths: np.ndarray) -> bool:
    """Whether depths (m), float64[ticks], end at the surface, or on the way there."""
    then = depths[-min(len(depths), round(STANDS_S / TICK_S))]
    return bool(depths[-1] < AT_SURFACE_M or depths[-1] < then - HANGS_M)


def _shown_s(scenario: Scenario, until_s: float) -> list[float]:
    """When (s) each fault showed: the first tick at which it changed a bit; inf: not by then.

    Each is compared with the flight that has only those before it, so that one of two that do the
    same shows.
    """
    flights = [
        _flown(scenario.model_copy(update={'faults': scenario.faults[:count]}), until_s)[-1]
        for count in range(len(scenario.faults) + 1)
    ]
    shown_s = []
    for without, flown in pairwise(flights):
        ticks = min(len(flown), len(without))
        differs = (flown[:ticks] != without[:ticks]).any(axis=1)
        shown_s.append(float(np.argmax(differs)) * TICK_S if differs.any() else np.inf)
    return shown_s


def _lost(scenario: Scenario, truth: Truth) -> str:
    """Why a vehicle is lost that could have been saved; empty if it is not, or could not."""
    vehicle = load_vehicle(scenario.vehicle)
    crush = vehicle.crush_depth_m
    if truth.deepest <= crush:
        return ''
    depth = truth.depth
    crossed_s = float(np.argmax(depth > crush)) if (depth > crush).any() else len(depth) - 1.0
    shown_s = _shown_s(scenario, crossed_s)
    in_time = [one + GRACE_S < crossed_s for one in shown_s]
    moments = [max(shown_s) + GRACE_S] if shown_s and all(in_time) else []
    too_deep = depth > (1.0 + BELOW_RATED) * vehicle.rated_depth_m
    if too_deep.any():
        moments.append(float(np.argmax(too_deep)))
    for moment in moments:
        # for as long as it lived: a leak may fill up one that has done all, at the surface
        done = _all_done(scenario, moment, max(due_s(crush), crossed_s - moment))
        if any(depths.max() <= crush and _comes_up(depths) for depths in done):
            return f'{truth.deepest:.0f} m deep (crush depth {crush:g}), saved at {moment:.0f} s'
    if any(in_time) and not all(in_time):
        # the last left nobody the time to act; are the others what somebody had to act on?
        faults = [fault for fault, one in zip(scenario.faults, in_time, strict=True) if one]
        without = scenario.model_copy(update={'faults': faults})
        alone = Truth()
        fly(without, [alone])
        return _lost(without, alone)
    return ''


def _late(scenario: Scenario, truth: Truth, begun_s: list[float]) -> str:
    """Why a vehicle is late that was sent to the surface for good and could have.

    A fault that strikes one that is up gives it its time anew, from when it has sunk it again: a
    slow leak takes hours to.
    """
    surfaces = (truth.rows & (SURFACES | DROPS)) != 0
    if not surfaces.any():
        return ''
    sent_up, depth = int(np.argmax(surfaces)), truth.depth
    struck = [round(one) for one in sorted(begun_s) if sent_up < one < len(depth) - 1.0]
    struck = [
        one + int(np.argmax(depth[one:] > SINKS_AGAIN_M))
        for one in struck
        if depth[one] < AT_SURFACE_M
    ]
    for start, end in pairwise([sent_up, *struck, len(depth)]):
        limit_s = due_s(float(depth[start]))
        late = depth[start + round(limit_s) : end]
        if not _is_under(late):
            continue
        best = _all_done(scenario, start + 1.0, end - start - 1.0)
        if any((depths[round(limit_s / TICK_S) :] < AT_SURFACE_M).all() for depths in best):
            return f'{late.max():.0f} m deep {limit_s:.0f} s after it was sent up at {start} s'
    return ''


def _is_under(depth: np.ndarray) -> bool:
    """Whether depths (m), float64[s], are under water, but for one that is soon up again."""
    up = np.flatnonzero(np.concatenate(([True], depth <= AT_SURFACE_M, [True])))
    return bool((depth > SINKS_AGAIN_M).any() or np.diff(up).max() > STANDS_S)


def _untold(scenario: Scenario, truth: Truth, status: str) -> str:
    """What went wrong without a word, of the guard or of the status."""
    vehicle, depth = load_vehicle(scenario.vehicle), truth.depth
    wrecked = truth.deepest > vehicle.crush_depth_m
    sent_up = bool(truth.rows[-1] & (SURFACES | DROPS))
    if (wrecked and status != 'lost') or (sent_up and status not in ('lost', 'surfaced')):
        return f'status {status}, {truth.deepest:.0f} m deep, {depth[-1]:.0f} m at the end'
    if truth.rows.any():
        return ''
    if truth.deepest > (1.0 + BELOW_RATED) * vehicle.rated_depth_m:
        return f'{truth.deepest:.0f} m deep (rated {vehicle.rated_depth_m:g})'
    for start in range(0, len(depth) - round(HANGS_S), 600):
        part = depth[start : start + round(HANGS_S)]
        if _hangs(part):
            return f'hangs at {part[-1]:.0f} m from {start} s on'
    return ''


def _hangs(depth: np.ndarray) -> bool:
    """Whether depths (m), float64[s], are those of a vehicle that stays at one under water."""
    return bool(depth.min() > AT_SURFACE_M and np.ptp(depth) < HANGS_M)


def unfounded(scenario: Scenario, truth: Truth, rows: int) -> int:
    """Those of some rows that were reported of a vehicle that truly went up or down.

    None is, where the first was reported of one that its whole pump does not bring up.
    """
    found, reported, stands_s = 0, truth.rows, round(STANDS_S)
    for bit in (1 << at for at in range(rows.bit_length()) if rows & 1 << at):
        if (reported & bit).any():
            at = int(np.argmax((reported & bit) != 0))
            if at < stands_s or not _hangs(truth.depth[at - stands_s : at]):
                found |= bit
    if found:
        first = int(np.argmax((reported & found) != 0))
        done = _all_done(scenario, first + 1.0, due_s(truth.deepest), drops=False)
        if not any(map(_comes_up, done)):
            return 0
    return found


def judge(
    scenario: Scenario, truth: Truth, status: str, reason: str, begun_s: list[float]
) -> Verdict:
    """What is wrong with a flight, by what its scorecard says and when faults began (s)."""
    if status == 'failed':
        return Verdict('not_finite', reason)
    for kind, why in (
        ('lost', _lost(scenario, truth)),
        ('late', _late(scenario, truth, begun_s)),
        ('untold', _untold(scenario, truth, status)),
    ):
        if why:
            return Verdict(kind, why)
    return Verdict('', '')
