# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The path of a mission as a person writes it, and the curve that is made of it."""

import math
from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
import pydantic
from pydantic import Field

from glider_base.settings import Settings, number
from glider_guidance.path.curve import CUBIC, HELIX, SAMPLES_PER_PIECE, PathParams, path_point

#: Paths stay this close to the origin (m, horizontally) and above this depth (m).
MAX_DISTANCE_M = 1e6
MAX_DEPTH_M = 12_000.0
#: Steepest path (deg). At 90 deg the course is undefined.
MAX_SLOPE_DEG = 80.0
#: Waypoints closer together than this coincide (m).
MIN_LEG_M = 1.0
#: A path through waypoints is at least so long (m): it is shorter than any turn of a glider.
MIN_WAY_M = 10.0
#: Who comes up within this of the last point (m) has arrived, as with targets of Seagliders.
ARRIVAL_RADIUS_M = 1000.0
#: Least norm(dp_d/ds) of a spline (m/m). Where it vanishes the tangent is undefined.
MIN_RATE = 0.1


def _cubic_params(knots: np.ndarray, coefficients: np.ndarray) -> PathParams:
    knots = np.ascontiguousarray(knots, dtype=float)
    return PathParams(
        kind=CUBIC,
        knots=knots,
        coefficients=np.ascontiguousarray(coefficients, dtype=float),
        ways=_horizontal_ways(knots, coefficients),
    )


def _horizontal_ways(knots: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """Horizontal way (m) from the start of a path of cubics to each knot."""
    x = np.diff(knots)[:, None] * np.linspace(0.0, 1.0, SAMPLES_PER_PIECE + 1)
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
    arrival_radius_m: float = number(
        ARRIVAL_RADIUS_M,
        (MIN_LEG_M, MAX_DISTANCE_M),
        'Who comes up farther from the last point (m) has not arrived, and flies on to it.',
    )

    def ending(self) -> dict[str, Any]:
        """Fields that say how it ends, for a path that takes its place."""
        return {'at_end': self.at_end, 'arrival_radius_m': self.arrival_radius_m}

    def params(self) -> PathParams:
        """Numbers that the kernels of `glider_guidance.path.curve` read."""
        raise NotImplementedError

    def _corners(self) -> np.ndarray:
        """Parameters that `points` must not leave out (m), both ends included."""
        return self.params().knots

    def course_rad(self) -> float:
        """Course at the start of the path (rad, clockwise from north)."""
        dn, de = self.params().coefficients[0, :2, 1]
        return math.atan2(de, dn)

    def points(self, n: int) -> np.ndarray:
        """Sample the path for display, every waypoint included: float64[n or more, 3] (m, NED).

        A path with more waypoints than ``n`` gives its waypoints.
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
    course_deg: float = number(
        0.0, (-360.0, 360.0), 'Course of the leg (deg, clockwise from north).'
    )
    length_m: float = number(..., (MIN_LEG_M, MAX_DISTANCE_M), 'Length of the leg (m).')

    @pydantic.field_validator('start')
    @classmethod
    def _check_start(cls, start: tuple[float, ...]) -> tuple[float, ...]:
        return _point(start, 'start')

    def params(self) -> PathParams:
        """Numbers that the kernels of `glider_guidance.path.curve` read."""
        course = self.course_rad()
        coefficients = np.zeros((1, 3, 4))
        coefficients[0, :, 0] = self.start
        coefficients[0, :, 1] = math.cos(course), math.sin(course), 0.0
        return _cubic_params(np.array([0.0, self.length_m]), coefficients)

    def course_rad(self) -> float:
        """Course of the leg (rad, clockwise from north)."""
        return math.radians(self.course_deg)


class _ThroughWaypoints(_PathSettings):
    """What paths through waypoints have in common."""

    kind: str
    waypoints: list[tuple[float, ...]] = Field(
        min_length=2,
        max_length=10_000,
        description='Waypoints [north, east] or [north, east, depth] (m).',
    )
    waypoints_latlon: list[tuple[float | str, float | str]] | None = Field(
        None,
        description='Waypoints [latitude, longitude] (deg, or degrees and minutes as '
        "'47 30.5 N'), or a Slocum's list such as goto_l10.ma, in place of waypoints, which a "
        'scenario makes of them.',
    )

    @pydantic.model_validator(mode='before')
    @classmethod
    def _check_chart(cls, values):
        if (
            isinstance(values, dict)
            and values.get('waypoints_latlon')
            and 'waypoints' not in values
        ):
            raise ValueError(
                'waypoints_latlon: there is no chart on board (allowed: waypoints, in m north and '
                'east of the origin)'
            )
        return values

    @pydantic.field_validator('waypoints')
    @classmethod
    def _check_waypoints(cls, waypoints: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
        """Refuse waypoints that make no path, and give each one a depth."""
        points = [_point(point, f'waypoint {i}') for i, point in enumerate(waypoints)]
        if len({len(point) for point in waypoints}) > 1:
            raise ValueError(
                'all waypoints need a depth, or none (allowed: 2 or 3 numbers in each)'
            )
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

    @pydantic.model_validator(mode='after')
    def _check_slopes(self):
        """Refuse a path so steep somewhere that it has no course, or one that turns on a cusp."""
        params = self.params()
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
        return self


class WaypointPath(_ThroughWaypoints):
    """Straight legs from waypoint to waypoint."""

    kind: Literal['waypoints']

    def params(self) -> PathParams:
        """Numbers that the kernels of `glider_guidance.path.curve` read."""
        return _polyline_params(np.array(self.waypoints))


class SplinePath(_ThroughWaypoints):
    """A smooth curve through waypoints: natural cubic spline over the length of its chords.

    Curvature is continuous, also into the straight continuation beyond both ends.
    """

    kind: Literal['spline']

    def params(self) -> PathParams:
        """Numbers that the kernels of `glider_guidance.path.curve` read."""
        from scipy.interpolate import CubicSpline  # 38 MB, which other paths do not need

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
    radius_m: float = number(..., (1.0, 10_000.0), 'Radius (m).')
    course_deg: float = number(
        0.0, (-360.0, 360.0), 'Course at the start (deg, clockwise from north).'
    )
    direction: Literal['cw', 'ccw'] = Field(
        default='cw', description='Clockwise (to starboard) or counterclockwise, from above.'
    )
    turns: float = number(..., (0.01, 1000.0), 'Number of turns (1).')
    descent_per_turn_m: float | None = number(
        None, (-MAX_DEPTH_M, MAX_DEPTH_M), 'Depth gained in a turn (m, + down); or give slope_deg.'
    )
    slope_deg: float | None = number(
        None,
        (-MAX_SLOPE_DEG, MAX_SLOPE_DEG),
        'Descent angle (deg, + down); or give descent_per_turn_m.',
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
        """Numbers that the kernels of `glider_guidance.path.curve` read."""
        turn = 1.0 if self.direction == 'cw' else -1.0
        slope = self._slope_rad()
        half_turn = math.pi * self.radius_m / math.cos(slope)
        length = 2.0 * self.turns * half_turn
        pieces = math.ceil(2.0 * self.turns)
        knots = half_turn * np.arange(pieces + 1.0)
        knots[-1] = length
        return PathParams(
            kind=HELIX,
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


def _hint(points: list[tuple[float, float, float]]) -> str:
    """What to say of waypoints so close together that could be degrees."""
    north, east = (max(abs(point[k]) for point in points) for k in range(2))
    if north > 90.0 or east > 180.0 or max(north, east) < MIN_LEG_M:
        return ''
    return '; metres north and east of the start, not latitude and longitude'
