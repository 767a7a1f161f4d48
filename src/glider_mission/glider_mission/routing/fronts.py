# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Fronts: the earliest arrival of a slow vehicle at every place of a chart, in a changing current.

Dijkstra's method with time as the label: from each point of a lattice, in the order of arrival, to
those around it in straight lines. A vehicle that can wait, or that is slowed by no water on a
line, never gains by arriving later, so that the first arrival is the earliest one (Lolla et al.,
Ocean Dynamics 64, 2014, solve the same by level sets). With the lines of `STENCIL` times are 0.3 %
too long on average, in half the speed of the vehicle.
"""

import heapq
import math
from typing import NamedTuple

import numpy as np

from glider_base.kernel import kernel
from glider_model.ocean.field import bracket

#: A line of the lattice reaches so many points far.
REACH = 5
#: Slowest way made good that counts (m/s), and the longest piece of a line in one current (m).
_SLOWEST, _PIECE_M = 0.02, 2500.0
#: A vehicle on its way looks for what to do so often (s), aims so far ahead on its route (m), and
#: from this near on heads for a waypoint (m). One that it cannot head for is passed from there on;
#: from nearer on a leg that is shorter than twice that, but not nearer than the last of these (m).
_LOOK_S, _AHEAD_M, NEAR_M, _NEAREST_M = 600.0, 3000.0, 1500.0, 20.0

#: Lines from a point to those around it, int64[n, 2] in steps to the north and to the east.
STENCIL = np.array(
    [
        (i, j)
        for i in range(-REACH, REACH + 1)
        for j in range(-REACH, REACH + 1)
        if math.gcd(i, j) == 1 and i * i + j * j <= REACH * REACH
    ]
)


class Chart(NamedTuple):
    """Depth-averaged current on a chart."""

    times: np.ndarray  #: float64[t] (s since the start), increasing
    norths: np.ndarray  #: float64[n] (m), increasing, evenly spaced
    easts: np.ndarray  #: float64[m], the same spacing
    current: np.ndarray  #: float32[t, n, m, 2], to the north and to the east (m/s)


@kernel
def current_on(chart, t_s, north, east):
    """Current of a chart, linear between its points, held beyond them (m/s)."""
    t, t_next, f_t = bracket(t_s, chart.times)
    n, n_next, f_n = bracket(north, chart.norths)
    e, e_next, f_e = bracket(east, chart.easts)
    water, v_n, v_e = chart.current, 0.0, 0.0
    for k in range(2):
        at = water[t] if k == 0 else water[t_next]
        share = 1.0 - f_t if k == 0 else f_t
        for c in range(2):
            low = (1.0 - f_e) * at[n, e, c] + f_e * at[n, e_next, c]
            high = (1.0 - f_e) * at[n_next, e, c] + f_e * at[n_next, e_next, c]
            value = share * ((1.0 - f_n) * low + f_n * high)
            if c == 0:
                v_n += value
            else:
                v_e += value
    return v_n, v_e


@kernel
def made_good(v_n, v_e, c_n, c_e, speed):
    """Speed over ground (m/s) along a course (unit vector); 0: it cannot be held."""
    along, across = v_n * c_n + v_e * c_e, v_e * c_n - v_n * c_e
    rest = speed * speed - across * across
    if not rest > 0.0:  # nor where there is land
        return 0.0
    return max(0.0, along + math.sqrt(rest))


@kernel
def line_arrival(chart, t_s, north, east, to_n, to_e, speed):
    """When a vehicle that leaves at ``t_s`` is at the end of a straight line (s); infinite: never.

    Each piece is flown in the current of its middle, in place and in time.
    """
    length = math.hypot(to_n - north, to_e - east)
    if length <= 0.0:
        return t_s
    c_n, c_e = (to_n - north) / length, (to_e - east) / length
    pieces = int(math.ceil(length / _PIECE_M))
    part = length / pieces
    for k in range(pieces):
        n, e = north + (k + 0.5) * part * c_n, east + (k + 0.5) * part * c_e
        at_s = t_s
        for _ in range(2):
            v_n, v_e = current_on(chart, at_s, n, e)
            rate = made_good(v_n, v_e, c_n, c_e, speed)
            if rate < _SLOWEST:
                return math.inf
            at_s = t_s + 0.5 * part / rate
        t_s += part / rate
    return t_s


@kernel
def fronts(chart, t_s, north, east, goal_n, goal_e, speed, end_s):
    """Earliest arrivals on the lattice of a chart, until the goal is reached.

    Parameters
    ----------
    chart : Chart
    t_s : float
        Time of the start (s).
    north, east, goal_n, goal_e : float
        Start and goal (m), within the chart.
    speed : float
        Through the water, horizontally (m/s).
    end_s : float
        Nobody looks further than to this time (s).

    Returns
    -------
    arrivals : float64[n, m]
        (s), infinite where it does not come before the goal or the end.
    before : int64[n * m]
        Point from which each is reached; -1: from the start, or not.
    goal_s : float
        Arrival at the goal; infinite: not in the time.
    last : int
        Point from which the goal is reached; -1: from the start.
    """
    norths, easts = chart.norths, chart.easts
    rows, columns = len(norths), len(easts)
    step = norths[1] - norths[0]
    arrivals, before = np.full(rows * columns, np.inf), np.full(rows * columns, -1)
    done = np.zeros(rows * columns, dtype=np.bool_)
    near = REACH * step
    goal_s, last = math.inf, -1
    if math.hypot(goal_n - north, goal_e - east) <= near:
        goal_s = line_arrival(chart, t_s, north, east, goal_n, goal_e, speed)
    heap = [(t_s, -1)]
    heap.pop()
    for i in range(rows):
        for j in range(columns):
            if math.hypot(norths[i] - north, easts[j] - east) <= near:
                reached = line_arrival(chart, t_s, north, east, norths[i], easts[j], speed)
                if reached < math.inf:
                    arrivals[i * columns + j] = reached
                    heapq.heappush(heap, (reached, i * columns + j))
    while len(heap) > 0:
        at_s, point = heapq.heappop(heap)
        if at_s > end_s or at_s >= goal_s:
            break
        if done[point]:
            continue
        done[point] = True
        i, j = point // columns, point % columns
        if math.hypot(goal_n - norths[i], goal_e - easts[j]) <= near:
            reached = line_arrival(chart, at_s, norths[i], easts[j], goal_n, goal_e, speed)
            if reached < goal_s:
                goal_s, last = reached, point
        for k in range(len(STENCIL)):
            a, b = i + STENCIL[k, 0], j + STENCIL[k, 1]
            if a < 0 or b < 0 or a >= rows or b >= columns or done[a * columns + b]:
                continue
            reached = line_arrival(chart, at_s, norths[i], easts[j], norths[a], easts[b], speed)
            if reached < arrivals[a * columns + b]:
                arrivals[a * columns + b] = reached
                before[a * columns + b] = point
                heapq.heappush(heap, (reached, a * columns + b))
    if goal_s > end_s:
        goal_s = math.inf
    return arrivals.reshape((rows, columns)), before, goal_s, last


@kernel
def sail(chart, t_s, route, speed, end_s):
    """Follow a route, as a vehicle does that aims at a point ahead of it on the way.

    Where the course to it cannot be held it steers across the current, and is carried.

    Parameters
    ----------
    chart : Chart
    t_s : float
        Time of the start (s).
    route : float64[n, 2]
        North and east of its corners (m); it starts at the first.
    speed : float
        Through the water (m/s).
    end_s : float
        It is given up at this time (s).

    Returns
    -------
    float
        Arrival at the last corner (s); infinite: not in the time.
    """
    north, east = route[0, 0], route[0, 1]
    leg = 0
    while t_s < end_s:
        goal_n, goal_e = route[leg + 1, 0], route[leg + 1, 1]
        d_n, d_e = goal_n - route[leg, 0], goal_e - route[leg, 1]
        length = max(1.0, math.hypot(d_n, d_e))
        d_n, d_e = d_n / length, d_e / length
        along = (north - route[leg, 0]) * d_n + (east - route[leg, 1]) * d_e
        off = math.hypot(goal_n - north, goal_e - east)
        near = min(NEAR_M, max(_NEAREST_M, NEAR_M * (0.5 * length / NEAR_M) ** 2))
        is_last, there_s = leg == len(route) - 2, math.inf
        if off <= NEAR_M:
            there_s = line_arrival(chart, t_s, north, east, goal_n, goal_e, speed)
        if there_s < math.inf:
            if is_last:
                return there_s if there_s <= end_s else math.inf
            t_s, north, east = there_s, goal_n, goal_e
        if not is_last and (there_s < math.inf or off <= near or along >= length):
            leg += 1
            continue
        ahead = min(length, max(0.0, along) + _AHEAD_M)
        aim_n, aim_e = route[leg, 0] + ahead * d_n - north, route[leg, 1] + ahead * d_e - east
        away = max(1.0, math.hypot(aim_n, aim_e))
        c_n, c_e = aim_n / away, aim_e / away
        v_n, v_e = current_on(chart, t_s, north, east)
        across = v_e * c_n - v_n * c_e
        rest = speed * speed - across * across
        if rest > 0.0:
            rate = v_n * c_n + v_e * c_e + math.sqrt(rest)
            ground_n, ground_e = rate * c_n, rate * c_e
        else:
            turn = -speed if across > 0.0 else speed
            ground_n, ground_e = v_n - turn * c_e, v_e + turn * c_n
        look_s = min(_LOOK_S, near / max(0.1, math.hypot(ground_n, ground_e)))
        north += look_s * ground_n
        east += look_s * ground_e
        t_s += look_s
    return math.inf
