# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The orders of a flight: what guidance does by each, and when it holds.

Whoever has them flies again to the same bits: the direct engine stops at their ticks, the guidance
node sets its parameters there, which is on record.
"""

import math
from collections.abc import Iterable, Sequence

import numpy as np
import pydantic

from glider_base.frames import VARIANCES
from glider_base.settings import ConfigurationError
from glider_base.signals import TICK_S
from glider_guidance.order import Order
from glider_guidance.path.settings import WaypointPath
from glider_guidance.settings import GuidanceSettings
from glider_guidance.yo.stage import AT_END_OF_PATH, SURFACE_PREPARATION, WAITING_ON_SURFACE


def changed(settings: GuidanceSettings, order: Order) -> GuidanceSettings:
    """What guidance is set to when an order holds.

    A ConfigurationError names the order, and why it makes no sense.
    """
    follows = settings.profile.mode == 'path'
    for name in ('depth_m', 'pitch_deg', 'wait_s', 'hold'):
        if follows and getattr(order, name):
            raise ConfigurationError(
                f'{name} = {getattr(order, name)}: a path in three dimensions says it itself '
                "(allowed: with profile.mode = 'profile')"
            )
    if order.hold and settings.hold:
        raise ConfigurationError('hold: the vehicle holds already (allowed: resume, abort)')
    if order.resume and not settings.hold:
        raise ConfigurationError('resume: the vehicle does not hold (allowed: after a hold)')
    changes = order.changes()
    of_profile = [name for name in changes if name.startswith('profile.')]
    kept = {name.removeprefix('profile.'): changes.pop(name) for name in of_profile}
    profile = settings.profile.model_copy(update=kept)
    ordered = settings.model_copy(update={**changes, 'profile': profile})
    ordered.check()
    return ordered


def due(orders: Iterable[Order], tick: int, stage: int) -> list[Order]:
    """Those that hold from a tick on; ``stage`` is that of guidance a tick before."""
    return [order for _, order in first_ticks(orders, tick, np.array([stage]))]


def first_ticks(orders: Iterable[Order], tick: int, stages: np.ndarray) -> list[tuple[int, Order]]:
    """Those that hold from one of some ticks on, with their row, in order; none after an abort.

    ``tick`` is the first of the ticks, ``stages``, int64[n], those of guidance a tick before each.
    Rows are counted from 0 on.
    """
    ticks, up = np.arange(len(stages)) + tick, is_surfaced(stages)
    found = []
    for order in orders:
        rows = np.flatnonzero((ticks >= order.tick) & (up | (order.when == 'once')))
        found += [(int(rows[0]), order)] if len(rows) else []
    found.sort(key=lambda one: (one[0], one[1].tick))
    last = next((i for i, (_, order) in enumerate(found) if order.abort), len(found))
    return found[: last + 1]


def reaction(
    settings: GuidanceSettings, no_progress: int, odom: Sequence[float], tick: int
) -> Order | None:
    """What guidance orders itself as it begins to tell of no progress, if anything.

    ``no_progress`` is the number of the waypoint that comes no nearer, ``odom`` are the numbers of
    the topic, from ``tick`` on the order holds.
    """
    at_s = round(tick * TICK_S, 1)
    if settings.no_progress == 'hold' and not settings.hold:
        return Order(at_s=at_s, hold=True)
    if settings.no_progress != 'skip' or settings.path.kind != 'waypoints':
        return None
    return _to(settings.path.waypoints[no_progress + 1 :], settings, odom, at_s)


def _to(
    points: Sequence[Sequence[float]],
    settings: GuidanceSettings,
    odom: Sequence[float],
    at_s: float,
) -> Order | None:
    """Order of the path from where it is through some points; None if it is there."""
    if not points:
        return None
    waypoints = [(float(odom[1]), float(odom[0]), points[0][2]), *points]
    try:
        path = WaypointPath(kind='waypoints', waypoints=waypoints, **settings.path.ending())
    except pydantic.ValidationError:
        return None
    return Order(at_s=at_s, path=path)


def judged_end(
    settings: GuidanceSettings, stage, odom, arrived: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Whether it is up at the end of its path, too far from its last point or arrived, bool[n].

    ``stage``, int[n], and ``odom``, float64[n, 17], the numbers of the topic, are those of ticks
    without an order between them. It has arrived when it surely is near enough, by twice the
    standard deviation of its place, and then may drift away; ``arrived`` says that it had before.
    """
    path, at_end = settings.path, np.equal(stage, AT_END_OF_PATH)
    if not at_end.any() or path.at_end != 'stop' or settings.profile.mode == 'path':
        return np.zeros((2, len(at_end)), bool)
    north, east, _ = path.points(0)[-1]
    off_m = np.hypot(odom[:, 1] - north, odom[:, 0] - east)
    sure_m = off_m + 2.0 * np.sqrt(np.maximum(odom[:, VARIANCES], 0.0).max(axis=1))
    had = arrived & np.logical_and.accumulate(at_end)
    has = had | np.logical_or.accumulate(at_end & (sure_m <= path.arrival_radius_m))
    return at_end & (off_m > path.arrival_radius_m) & ~has, has


def to_end(settings: GuidanceSettings, odom: Sequence[float], tick: int) -> Order | None:
    """What guidance orders itself where it missed its end: to fly on to the last point."""
    points = [tuple(map(float, settings.path.points(0)[-1]))]
    return _to(points, settings, odom, round(tick * TICK_S, 1))


def begins(no_progress: np.ndarray, before: float) -> np.ndarray:
    """Rows in which guidance begins to tell of no progress, int[n]; ``before``: a row earlier."""
    return np.flatnonzero((no_progress > 0) & (np.concatenate([[before], no_progress[:-1]]) == 0))


def ticks_alone(orders: Iterable[Order], tick: int) -> float:
    """For so many ticks none becomes due by its time."""
    return min((one.tick - tick for one in orders if one.tick > tick), default=math.inf)


def wait_for_surface(orders: Iterable[Order], tick: int) -> bool:
    """Whether one holds as soon as the vehicle is at the surface."""
    return any(one.tick <= tick and one.when == 'surfacing' for one in orders)


def is_surfaced(stage):
    """Whether guidance has the vehicle at the surface, int or int[n]."""
    return (
        (stage == WAITING_ON_SURFACE) | (stage == SURFACE_PREPARATION) | (stage == AT_END_OF_PATH)
    )


def check_orders(
    settings: GuidanceSettings, orders: Iterable[Order], name: str = 'orders.{}.'
) -> None:
    """Refuse orders of a mission that make no sense one after the other.

    ``settings`` are those before the first of them, ``name`` is what one is called by its number.
    A ConfigurationError names the order.
    """
    is_aborted = False
    for i, order in sorted(enumerate(orders), key=lambda one: one[1].tick):
        try:
            if is_aborted:
                raise ConfigurationError(
                    f'at_s = {order.at_s:g}: the mission is aborted before (allowed: nothing more)'
                )
            settings, is_aborted = changed(settings, order), order.abort
        except ConfigurationError as error:
            raise ConfigurationError(f'{name.format(i)}{error}') from None
