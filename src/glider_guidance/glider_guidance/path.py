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
from itertools import pairwise
from typing import Annotated, Literal, NamedTuple

import numpy as np
import pydantic
from pydantic import Field
from scipy.interpolate import CubicSpline

from glider_model.base.kernel import kernel
from glider_model.base.settings import Settings
from glider_model.base.signals import TrackingError

#: Paths stay this close to the origin (m, horizontally) and above this depth (m).
MAX_DISTANCE_M = 1e6
MAX_DEPTH_M = 12_000.0
#: Steepest path (deg). At 90 deg the course is undefined.
MAX_SLOPE_DEG = 80.0
#: Waypoints closer together than this coincide (m).
MIN_LEG_M = 1.0
#: A path through waypoints is at least so long (m): it is shorter than any turn of a glider.
MIN_WAY_M = 10.0
#: Least norm(dp_d/ds) of a spline (m/m). Where it vanishes the tangent is undefined.
MIN_RATE = 0.1

_CUBIC, _HELIX = 0, 1
_SAMPLES_PER_PIECE = 16
_BISECTIONS = 60
#: A later point of the path must be nearer by this much (m) to be called the closest.
_CLOSER_M = 1e-6


# ---------------------------------------------------------------------------------- what runs


#: Step along the path over which its turn is measured (m); a larger turn in it is a corner (rad).
_TURN_STEP_M, _CORNER_RAD = 1.0, 0.2


class PathParams(NamedTuple):
    """A path as a chain of pieces: cubic polynomials, or half turns of a helix."""

    kind: int  #: cubic (0) or helix (1)
    knots: np.ndarray  #: float64[n + 1], s at the ends of the pieces (m), from 0
    coefficients: (
        np.ndarray
    )  #: float64[n, 3, 4], NED (m) by powers 0..3 of s - knots[i]; cubic only
    centre_n: float  #: axis of the helix (m)
    centre_e: float  #: (m)
    start_d: float  #: depth where the helix starts (m)
    radius: float  #: of the helix (m)
    bearing: float  #: from the axis to the start of the helix (rad, clockwise from north)
    turn: float  #: sense of the helix, seen from above: +1 clockwise, -1 counterclockwise
    slope: float  #: descent angle of the helix (rad, + down)
    ways: np.ndarray  #: float64[n + 1], horizontal way along the path at the knots (m), from 0


@kernel
def path_length(params):
    """Parameter s at the end of the path (m); it starts at 0."""
    return params.knots[-1]


@kernel
def _piece(i, s, params):
    """Point (m, NED) and its derivative by s of piece ``i``, which is not held to its ends."""
    if params.kind == _HELIX:
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
    """Point of the path.

    Parameters
    ----------
    s : float
        Path parameter (m); before 0 and beyond `path_length` the path goes on straight.
    params : PathParams

    Returns
    -------
    p_n, p_e, p_d : float
        (m, NED)
    """
    i, inside = path_piece(s, params)
    n, e, d, dn, de, dd = _piece(i, inside, params)
    beyond = s - inside
    return n + beyond * dn, e + beyond * de, d + beyond * dd


@kernel
def path_tangent(s, params):
    """Tangent of the path: the derivative of `path_point` by s, of a length near 1.

    Parameters
    ----------
    s : float
        Path parameter (m). At a corner the leg that follows counts.
    params : PathParams

    Returns
    -------
    dn, de, dd : float
        (m/m, NED)
    """
    i, inside = path_piece(s, params)
    _, _, _, dn, de, dd = _piece(i, inside, params)
    return dn, de, dd


@kernel
def path_angles(dn, de, dd):
    """Course and elevation of a tangent.

    Parameters
    ----------
    dn, de, dd : float
        Tangent (NED), of any length.

    Returns
    -------
    gamma_d : float
        Course (rad, clockwise from north), atan2(y', x').
    rho_d : float
        Elevation (rad, + climbing), atan2(-z', hypot(x', y')). Zhang et al. (2021) eq. 4 prints
        both with the position in place of the tangent.
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

    Parameters
    ----------
    p_n, p_e, p_d : float
        Position of the vehicle p_NB (m, NED).
    s : float
        Parameter of the virtual target on the path (m).
    gamma_d, rho_d : float
        Course and elevation of the path frame (rad); ``rho_d = 0`` for a horizontal frame.
    params : PathParams

    Returns
    -------
    TrackingError
        e1 ahead of the target, e2 to starboard of the path, e3 below it (m).
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
    """Parameter of the point of the path that is closest to a position.

    Parameters
    ----------
    p_n, p_e, p_d : float
        Position (m, NED).
    horizontal : bool
        Measure the distance in the horizontal plane only.
    params : PathParams

    Returns
    -------
    float
        s within [0, `path_length`] (m); the smallest one where several are equally close.
    """
    best_s, best = 0.0, math.inf
    # Every local minimum lies where the distance stops falling: between two samples, at a corner,
    # at the start, or at the end. `low` and `low_slope` are the previous sample.
    low, low_slope = 0.0, -1.0
    pieces = len(params.knots) - 1
    for i in range(pieces):
        start = params.knots[i]
        step = (params.knots[i + 1] - start) / _SAMPLES_PER_PIECE
        low = start
        for j in range(_SAMPLES_PER_PIECE + 1):
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


# ------------------------------------------------------------------------- what a person writes


def _cubic_params(knots: np.ndarray, coefficients: np.ndarray) -> PathParams:
    knots = np.ascontiguousarray(knots, dtype=float)
    return PathParams(
        kind=_CUBIC,
        knots=knots,
        coefficients=np.ascontiguousarray(coefficients, dtype=float),
        ways=_horizontal_ways(knots, coefficients),
        centre_n=0.0,
        centre_e=0.0,
        start_d=0.0,
        radius=0.0,
        bearing=0.0,
        turn=0.0,
        slope=0.0,
    )


def _horizontal_ways(knots: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """Horizontal way (m) from the start of a path of cubics to each knot."""
    x = np.diff(knots)[:, None] * np.linspace(0.0, 1.0, _SAMPLES_PER_PIECE + 1)
    c = coefficients[:, :2, :, None]
    at = c[:, :, 0] + x[:, None] * (
        c[:, :, 1] + x[:, None] * (c[:, :, 2] + x[:, None] * c[:, :, 3])
    )
    steps = np.hypot(*np.moveaxis(np.diff(at, axis=2), 1, 0))
    return np.concatenate(([0.0], np.cumsum(steps.sum(axis=1))))


def _polyline_params(waypoints: np.ndarray) -> PathParams:
    """Straight legs through float64[n, 3] waypoints, parametrised by arc length."""
    legs = np.diff(waypoints, axis=0)
    lengths = np.linalg.norm(legs, axis=1)
    coefficients = np.zeros((len(legs), 3, 4))
    coefficients[:, :, 0] = waypoints[:-1]
    coefficients[:, :, 1] = legs / lengths[:, None]
    return _cubic_params(np.concatenate(([0.0], np.cumsum(lengths))), coefficients)


def _point(values: tuple[float, ...], name: str) -> tuple[float, float, float]:
    """Check a point [north, east] or [north, east, depth], and give it a depth (m)."""
    if len(values) not in (2, 3):
        raise ValueError(
            f'{name} = {list(values)!r}: {len(values)} numbers (allowed: [north, east] or '
            '[north, east, depth])'
        )
    if max(abs(values[0]), abs(values[1])) > MAX_DISTANCE_M:
        raise ValueError(
            f'{name} = {list(values)!r}: north and east are allowed >= {-MAX_DISTANCE_M} and '
            f'<= {MAX_DISTANCE_M} m'
        )
    depth = values[2] if len(values) == 3 else 0.0
    if not 0.0 <= depth <= MAX_DEPTH_M:
        raise ValueError(
            f'{name} = {list(values)!r}: the depth is allowed >= 0.0 and <= {MAX_DEPTH_M} m'
        )
    return (values[0], values[1], depth)


class _PathSettings(Settings):
    """What all paths have in common."""

    at_end: Literal['stop', 'continue'] = Field(
        'stop',
        description='At the end: stop, come up and end the mission; or continue straight on.',
    )

    def params(self) -> PathParams:
        """Numbers that the kernels of this module read."""
        raise NotImplementedError

    def _corners(self) -> np.ndarray:
        """Parameters that `points` must not leave out (m), both ends included."""
        return self.params().knots

    def course_rad(self) -> float:
        """Course at the start of the path (rad, clockwise from north)."""
        dn, de = self.params().coefficients[0, :2, 1]
        return math.atan2(de, dn)

    def points(self, n: int) -> np.ndarray:
        """Sample the path for display, every waypoint included.

        Parameters
        ----------
        n : int
            Number of points; a path with more waypoints than this gives its waypoints.

        Returns
        -------
        float64[max(n, number of waypoints), 3]
            (m, NED)
        """
        params, corners = self.params(), self._corners()
        lengths = np.diff(corners)
        counts = np.ones(len(lengths), dtype=int)
        for _ in range(n - len(corners)):
            counts[np.argmax(lengths / counts)] += 1
        s = [
            np.linspace(start, end, count, endpoint=False)
            for (start, end), count in zip(pairwise(corners), counts, strict=True)
        ]
        return np.array([path_point(x, params) for x in [*np.concatenate(s), corners[-1]]])


class StraightPath(_PathSettings):
    """One horizontal straight leg."""

    kind: Literal['straight']
    start: tuple[float, ...] = Field(
        default=(0.0, 0.0, 0.0), description='Start [north, east] or [north, east, depth] (m).'
    )
    course_deg: float = Field(
        default=0.0,
        ge=-360.0,
        le=360.0,
        description='Course of the leg (deg, clockwise from north).',
    )
    length_m: float = Field(ge=MIN_LEG_M, le=MAX_DISTANCE_M, description='Length of the leg (m).')

    @pydantic.field_validator('start')
    @classmethod
    def _check_start(cls, start: tuple[float, ...]) -> tuple[float, ...]:
        return _point(start, 'start')

    def params(self) -> PathParams:
        """Numbers that the kernels of this module read."""
        course = self.course_rad()
        coefficients = np.zeros((1, 3, 4))
        coefficients[0, :, 0] = self.start
        coefficients[0, :, 1] = math.cos(course), math.sin(course), 0.0
        return _cubic_params(np.array([0.0, self.length_m]), coefficients)

    def course_rad(self) -> float:
        """Course of the leg (rad, clockwise from north)."""
        return math.radians(self.course_deg)


class WaypointPath(_PathSettings):
    """Straight legs from waypoint to waypoint."""

    kind: Literal['waypoints']
    waypoints: list[tuple[float, ...]] = Field(
        min_length=2,
        max_length=10_000,
        description='Waypoints [north, east] or [north, east, depth] (m).',
    )

    @pydantic.field_validator('waypoints')
    @classmethod
    def _check_waypoints(cls, waypoints: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
        return _check_waypoints(waypoints)

    @pydantic.model_validator(mode='after')
    def _check_slopes(self):
        _check_slopes(self.params())
        return self

    def params(self) -> PathParams:
        """Numbers that the kernels of this module read."""
        return _polyline_params(np.array(self.waypoints))


class SplinePath(_PathSettings):
    """A smooth curve through waypoints: natural cubic spline over the length of its chords.

    Curvature is continuous, also into the straight continuation beyond both ends.
    """

    kind: Literal['spline']
    waypoints: list[tuple[float, ...]] = Field(
        min_length=2,
        max_length=10_000,
        description='Waypoints [north, east] or [north, east, depth] (m).',
    )

    @pydantic.field_validator('waypoints')
    @classmethod
    def _check_waypoints(cls, waypoints: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
        return _check_waypoints(waypoints)

    @pydantic.model_validator(mode='after')
    def _check_slopes(self):
        _check_slopes(self.params())
        return self

    def params(self) -> PathParams:
        """Numbers that the kernels of this module read."""
        waypoints = np.array(self.waypoints)
        knots = _polyline_params(waypoints).knots
        spline = CubicSpline(knots, waypoints, bc_type='natural')
        return _cubic_params(knots, np.transpose(spline.c[::-1], (1, 2, 0)))


class HelixPath(_PathSettings):
    """Circles around a vertical axis, level or descending or climbing at a constant slope."""

    kind: Literal['helix']
    centre: tuple[float, ...] = Field(
        default=(0.0, 0.0, 0.0),
        description='Axis [north, east], or [north, east, depth] with the depth of the start (m).',
    )
    radius_m: float = Field(ge=1.0, le=10_000.0, description='Radius (m).')
    course_deg: float = Field(
        default=0.0,
        ge=-360.0,
        le=360.0,
        description='Course at the start (deg, clockwise from north).',
    )
    direction: Literal['cw', 'ccw'] = Field(
        default='cw', description='Clockwise (to starboard) or counterclockwise, from above.'
    )
    turns: float = Field(ge=0.01, le=1000.0, description='Number of turns (1).')
    descent_per_turn_m: float | None = Field(
        default=None,
        ge=-MAX_DEPTH_M,
        le=MAX_DEPTH_M,
        description='Depth gained in a turn (m, + down); or give slope_deg.',
    )
    slope_deg: float | None = Field(
        default=None,
        ge=-MAX_SLOPE_DEG,
        le=MAX_SLOPE_DEG,
        description='Descent angle (deg, + down); or give descent_per_turn_m.',
    )

    @pydantic.field_validator('centre')
    @classmethod
    def _check_centre(cls, centre: tuple[float, ...]) -> tuple[float, ...]:
        return _point(centre, 'centre')

    @pydantic.model_validator(mode='after')
    def _check_descent(self):
        if (self.descent_per_turn_m is None) == (self.slope_deg is None):
            found = 'neither' if self.slope_deg is None else 'both'
            raise ValueError(
                f'give exactly one of descent_per_turn_m and slope_deg, found {found}'
            )
        slope_deg = math.degrees(self._slope_rad())
        if abs(slope_deg) > MAX_SLOPE_DEG:
            raise ValueError(
                f'descent_per_turn_m = {self.descent_per_turn_m!r} on radius_m = '
                f'{self.radius_m!r} is a slope of {slope_deg:.1f} deg (allowed: '
                f'>= {-MAX_SLOPE_DEG} and <= {MAX_SLOPE_DEG})'
            )
        end_d = self.centre[2] + 2.0 * math.pi * self.radius_m * self.turns * math.tan(
            self._slope_rad()
        )
        if not -1e-6 <= end_d <= MAX_DEPTH_M:
            raise ValueError(
                f'the helix ends at a depth of {end_d:.1f} m (allowed: >= 0.0 and '
                f'<= {MAX_DEPTH_M}); change turns, centre, or the descent'
            )
        return self

    def _slope_rad(self) -> float:
        if self.slope_deg is not None:
            return math.radians(self.slope_deg)
        return math.atan2(self.descent_per_turn_m, 2.0 * math.pi * self.radius_m)

    def _corners(self) -> np.ndarray:
        return self.params().knots[[0, -1]]

    def params(self) -> PathParams:
        """Numbers that the kernels of this module read."""
        turn = 1.0 if self.direction == 'cw' else -1.0
        slope = self._slope_rad()
        half_turn = math.pi * self.radius_m / math.cos(slope)
        length = 2.0 * self.turns * half_turn
        pieces = math.ceil(2.0 * self.turns)
        knots = half_turn * np.arange(pieces + 1.0)
        knots[-1] = length
        return PathParams(
            kind=_HELIX,
            knots=knots,
            coefficients=np.zeros((0, 3, 4)),
            centre_n=self.centre[0],
            centre_e=self.centre[1],
            start_d=self.centre[2],
            radius=self.radius_m,
            bearing=self.course_rad() - turn * math.pi / 2.0,
            turn=turn,
            slope=slope,
            ways=knots * math.cos(slope),
        )

    def course_rad(self) -> float:
        """Course at the start (rad, clockwise from north)."""
        return math.radians(self.course_deg)


PathSettings = Annotated[
    StraightPath | WaypointPath | SplinePath | HelixPath, Field(discriminator='kind')
]


def _check_waypoints(waypoints: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
    """Refuse waypoints that make no path, and give each one a depth."""
    points = [_point(point, f'waypoint {i}') for i, point in enumerate(waypoints)]
    if len({len(point) for point in waypoints}) > 1:
        raise ValueError('all waypoints need a depth, or none (allowed: 2 or 3 numbers in each)')
    for i, (one, after) in enumerate(pairwise(points)):
        length = math.dist(one, after)
        if length < MIN_LEG_M:
            raise ValueError(
                f'waypoints {i} and {i + 1} coincide: {list(one)!r} and {list(after)!r} are '
                f'{length:.3f} m apart (allowed: >= {MIN_LEG_M} m{_hint(points)})'
            )
    length = sum(math.dist(one, after) for one, after in pairwise(points))
    if length < MIN_WAY_M:
        raise ValueError(
            f'the whole path is {length:.3f} m long (allowed: >= {MIN_WAY_M} m{_hint(points)})'
        )
    return points


def _hint(points: list[tuple[float, float, float]]) -> str:
    """What to say of waypoints so close together that could be degrees."""
    if any(abs(point[0]) > 90.0 or abs(point[1]) > 180.0 for point in points):
        return ''
    return '; metres north and east of the start, not latitude and longitude'


def _check_slopes(params: PathParams) -> None:
    """Refuse a path that is somewhere so steep that it has no course, or that turns on a cusp."""
    x = np.diff(params.knots)[:, None] * np.linspace(0.0, 1.0, 65)
    c = params.coefficients[:, :, :, None]
    dn, de, dd = np.moveaxis(
        c[:, :, 1] + x[:, None] * (2.0 * c[:, :, 2] + 3.0 * x[:, None] * c[:, :, 3]), 1, 0
    )
    slopes_deg = np.degrees(np.arctan2(dd, np.hypot(dn, de)))
    steepest, sample = np.unravel_index(np.argmax(np.abs(slopes_deg)), slopes_deg.shape)
    slope_deg = slopes_deg[steepest, sample]
    if abs(slope_deg) > MAX_SLOPE_DEG:
        raise ValueError(
            f'the path between waypoints {steepest} and {steepest + 1} has a slope of '
            f'{slope_deg:.1f} deg (allowed: >= {-MAX_SLOPE_DEG} and <= {MAX_SLOPE_DEG}; a '
            'vertical path has no course)'
        )
    rates = np.sqrt(dn**2 + de**2 + dd**2)
    slowest, sample = np.unravel_index(np.argmin(rates), rates.shape)
    if rates[slowest, sample] < MIN_RATE:
        raise ValueError(
            f'the spline turns on the spot near waypoint {slowest + round(sample / 64)}: '
            'lead it around in a curve'
        )
