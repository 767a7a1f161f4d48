# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Desired paths p_d(s) in NED, and where a vehicle is relative to them.

Every path is a function of a parameter s in metres. On straight legs and helices s is the arc
length; on a spline it is the length of the chords between its waypoints, which the arc length
exceeds a little, so that norm(dp_d/ds) is near 1 but not 1. Beyond either end a path goes on
straight along its last tangent, so that guidance never runs out of path.

The path frame has its x axis along the tangent: R_NP = Q = Rz(gamma_d) Ry(rho_d), with gamma_d the
course of the path and rho_d its elevation (+ climbing).
"""

import math
from typing import NamedTuple

import numpy as np

from glider_base.kernel import kernel
from glider_base.signals import TrackingError

#: Kinds of paths.
CUBIC, HELIX = 0, 1
#: So many samples of a piece tell its length and where on it the distance falls.
SAMPLES_PER_PIECE = 16
_BISECTIONS = 60
#: A later point of the path must be nearer by this much (m) to be called the closest.
_CLOSER_M = 1e-6
#: Step along the path over which its turn is measured (m); a larger turn in it is a corner (rad).
_TURN_STEP_M, _CORNER_RAD = 1.0, 0.2
#: Who is so near to start and end of a path that comes back is at its start (m).
_BACK_M = 1000.0


class PathParams(NamedTuple):
    """A path as a chain of pieces: cubic polynomials, or half turns of a helix."""

    kind: int  #: cubic (0) or helix (1)
    knots: np.ndarray  #: float64[n + 1], s at the ends of the pieces (m), from 0
    #: float64[n, 3, 4], NED (m) by powers 0..3 of s - knots[i]; cubic only
    coefficients: np.ndarray
    ways: np.ndarray  #: float64[n + 1], horizontal way along the path at the knots (m), from 0
    centre_n: float = 0.0  #: axis of the helix (m)
    centre_e: float = 0.0  #: (m)
    start_d: float = 0.0  #: depth where the helix starts (m)
    radius: float = 0.0  #: of the helix (m)
    bearing: float = 0.0  #: from the axis to the start of the helix (rad, clockwise from north)
    turn: float = 0.0  #: sense of the helix, seen from above: +1 clockwise, -1 counterclockwise
    slope: float = 0.0  #: descent angle of the helix (rad, + down)


@kernel
def path_length(params):
    """Parameter s at the end of the path (m); it starts at 0."""
    return params.knots[-1]


@kernel
def _piece(i, s, params):
    """Point (m, NED) and its derivative by s of piece ``i``, which is not held to its ends."""
    if params.kind == HELIX:
        flat, steep = math.cos(params.slope), math.sin(params.slope)
        bearing = params.bearing + params.turn * s * flat / params.radius
        cosine, sine = math.cos(bearing), math.sin(bearing)
        return (
            params.centre_n + params.radius * cosine,
            params.centre_e + params.radius * sine,
            params.start_d + s * steep,
            -params.turn * flat * sine,
            params.turn * flat * cosine,
            steep,
        )
    x = s - params.knots[i]
    c = params.coefficients[i]
    return (
        c[0, 0] + x * (c[0, 1] + x * (c[0, 2] + x * c[0, 3])),
        c[1, 0] + x * (c[1, 1] + x * (c[1, 2] + x * c[1, 3])),
        c[2, 0] + x * (c[2, 1] + x * (c[2, 2] + x * c[2, 3])),
        c[0, 1] + x * (2.0 * c[0, 2] + 3.0 * x * c[0, 3]),
        c[1, 1] + x * (2.0 * c[1, 2] + 3.0 * x * c[1, 3]),
        c[2, 1] + x * (2.0 * c[2, 2] + 3.0 * x * c[2, 3]),
    )


@kernel
def path_piece(s, params):
    """Piece that holds s, and s held to the ends of the path. A knot belongs to what follows."""
    knots = params.knots
    inside = min(max(s, 0.0), knots[-1])
    low, high = 0, len(knots) - 1
    while high - low > 1:
        middle = (low + high) // 2
        if knots[middle] <= inside:
            low = middle
        else:
            high = middle
    return low, inside


@kernel
def path_point(s, params):
    """Point of the path (m, NED; 3 numbers).

    ``s`` (m) is the path parameter; before 0 and beyond `path_length` the path goes on straight.
    """
    i, inside = path_piece(s, params)
    n, e, d, dn, de, dd = _piece(i, inside, params)
    beyond = s - inside
    return n + beyond * dn, e + beyond * de, d + beyond * dd


@kernel
def path_tangent(s, params):
    """Tangent of the path (m/m, NED; 3 numbers), of a length near 1.

    The derivative of `path_point` by s; at a corner the leg that follows counts.
    """
    i, inside = path_piece(s, params)
    _, _, _, dn, de, dd = _piece(i, inside, params)
    return dn, de, dd


@kernel
def path_angles(dn, de, dd):
    """Course and elevation (rad; clockwise from north, + climbing) of a tangent of any length.

    atan2(y', x') and atan2(-z', hypot(x', y')): Zhang et al. (2021) eq. 4 prints both with the
    position in place of the tangent.
    """
    return math.atan2(de, dn), math.atan2(-dd, math.hypot(dn, de))


@kernel
def path_turn(s, params):
    """Change of course per metre (rad/m, + to starboard) at ``s``; 0 across a corner."""
    n_1, e_1, _ = path_tangent(s, params)
    n_2, e_2, _ = path_tangent(s + _TURN_STEP_M, params)
    turn = math.atan2(n_1 * e_2 - e_1 * n_2, n_1 * n_2 + e_1 * e_2)
    return turn / _TURN_STEP_M if abs(turn) < _CORNER_RAD else 0.0


@kernel
def path_errors(p_n, p_e, p_d, s, gamma_d, rho_d, params):
    """Position of the vehicle in the path frame, e = Q^T (p - p_d(s)).

    e1 is ahead of the target at s (m), e2 to starboard of the path, e3 below it (m). The position
    p_NB is in m, NED; gamma_d and rho_d are course and elevation of the path frame (rad), rho_d =
    0 for a horizontal frame.
    """
    n, e, d = path_point(s, params)
    dn, de, dd = p_n - n, p_e - e, p_d - d
    cg, sg, cr, sr = math.cos(gamma_d), math.sin(gamma_d), math.cos(rho_d), math.sin(rho_d)
    ahead = cg * dn + sg * de
    return TrackingError(cr * ahead - sr * dd, cg * de - sg * dn, sr * ahead + cr * dd)


@kernel
def _distance(i, s, p_n, p_e, p_d, horizontal, params):
    """Distance to a point of piece ``i`` (m), and half the derivative of its square by s (m)."""
    n, e, d, dn, de, dd = _piece(i, s, params)
    n, e, d = n - p_n, e - p_e, d - p_d
    if horizontal:
        return math.hypot(n, e), n * dn + e * de
    return math.sqrt(n * n + e * e + d * d), n * dn + e * de + d * dd


@kernel
def _nearest_between(i, low, high, p_n, p_e, p_d, horizontal, params):
    """Minimum of the distance to piece ``i`` (s and distance, m), bracketed by [low, high]."""
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        _, slope = _distance(i, middle, p_n, p_e, p_d, horizontal, params)
        if slope < 0.0:
            low = middle
        else:
            high = middle
    distance, _ = _distance(i, high, p_n, p_e, p_d, horizontal, params)
    return high, distance


@kernel
def path_closest(p_n, p_e, p_d, horizontal, params):
    """Parameter s (m) of the point of the path that is closest to a position (m, NED).

    Within [0, `path_length`]; the smallest one where several are equally close. ``horizontal``
    says that the distance is that in the horizontal plane.
    """
    best_s, best = 0.0, math.inf
    # Every local minimum lies where the distance stops falling: between two samples, at a corner,
    # at the start, or at the end. `low` and `low_slope` are the previous sample.
    low, low_slope = 0.0, -1.0
    pieces = len(params.knots) - 1
    for i in range(pieces):
        start = params.knots[i]
        step = (params.knots[i + 1] - start) / SAMPLES_PER_PIECE
        low = start
        for j in range(SAMPLES_PER_PIECE + 1):
            high = start + j * step
            _, high_slope = _distance(i, high, p_n, p_e, p_d, horizontal, params)
            if low_slope < 0.0 <= high_slope:
                s, distance = _nearest_between(i, low, high, p_n, p_e, p_d, horizontal, params)
                if distance < best - _CLOSER_M:
                    best_s, best = s, distance
            low, low_slope = high, high_slope
    if low_slope < 0.0:
        distance, _ = _distance(pieces - 1, low, p_n, p_e, p_d, horizontal, params)
        if distance < best - _CLOSER_M:
            best_s = low
    return min(best_s, params.knots[-1])


@kernel
def path_entry(p_n, p_e, p_d, horizontal, params):
    """Parameter s (m) at which a path is entered: that of its `path_closest` point.

    On a path that comes back to where it begins, who is there has all of it before him.
    """
    s, length = path_closest(p_n, p_e, p_d, horizontal, params), path_length(params)
    n, e, _ = path_point(0.0, params)
    end_n, end_e, _ = path_point(length, params)
    comes_back = 2.0 * math.hypot(end_n - n, end_e - e) < length
    is_there = length - s < _BACK_M and math.hypot(p_n - n, p_e - e) < _BACK_M
    return 0.0 if horizontal and comes_back and is_there else s
