# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What is measured of a flight beside its score."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from glider_base.frames import within_180
from glider_bringup.scoring.one_hertz import Record
from glider_bringup.scoring.score import windows
from glider_bringup.scoring.scores import largest, mean, rms
from glider_guidance.los import crab_heading
from glider_mission.planned import horizontal_speed
from glider_mission.scenario import Scenario

#: Time between two samples of a `Record` (s).
_SAMPLE_S = 1.0
#: A leg of a survey is looked at this long after its corner (s).
CORNER_S = 600.0


def _windows(record: Record, scenario: Scenario) -> tuple[np.ndarray, np.ndarray]:
    """Masks of the steady and of all scored samples."""
    rules = scenario.score_rules(len(record.time_s) * _SAMPLE_S)
    return windows(record.depth, record.descending, rules, _SAMPLE_S)


def measure_attitude(record: Record, scenario: Scenario) -> dict[str, Any]:
    """Roll, heading error, and mean pitch and pitch mass in dive and climb, steady."""
    steady, _ = _windows(record, scenario)
    error = within_180(record.heading - record.heading_ref)[steady]
    down, up = steady & record.descending, steady & ~record.descending
    pitch_mass = 1e3 * record.joints[:, 1]
    return {
        'heading_error_deg': {'rms_steady': rms(error), 'max_steady': largest(error)},
        'roll_deg': {
            'rms_steady': rms(record.roll[steady]),
            'max_steady': largest(record.roll[steady]),
        },
        'trim': {
            'pitch_dive_deg': mean(record.pitch[down]),
            'pitch_climb_deg': mean(record.pitch[up]),
            'pitch_mass_dive_mm': mean(pitch_mass[down]),
            'pitch_mass_climb_mm': mean(pitch_mass[up]),
        },
    }


def measure_path(record: Record, scenario: Scenario) -> dict[str, Any]:
    """Errors across the path (e2) and normal to it (e3), after the settling time."""
    _, scored = _windows(record, scenario)
    across, below = record.cross_track[scored], record.vertical_error[scored]
    return {
        'path_error_m': {
            'e2_rms': rms(across),
            'e3_rms': rms(below),
            'e2_max': largest(across),
            'e3_max': largest(below),
        }
    }


def measure_survey(record: Record, scenario: Scenario) -> dict[str, Any]:
    """How close every waypoint was passed, and how calm the heading was in every leg."""
    closest = [
        float(np.min(np.hypot(record.north - waypoint[0], record.east - waypoint[1])))
        for waypoint in scenario.path.waypoints
    ]
    return {'waypoints_closest_m': closest, 'legs': list(_legs(record))}


def _legs(record: Record) -> Iterator[dict[str, float]]:
    """What the heading did in every leg, from `CORNER_S` after its corner on.

    Heading and course are both counted on through +-180 deg, so that a loop shows as 360 deg
    between them.
    """
    steps = np.diff(record.target_north), np.diff(record.target_east)
    moves = np.flatnonzero(np.hypot(*steps) > 0.0)
    if not len(moves):
        return
    course = np.degrees(np.unwrap(np.arctan2(steps[1][moves], steps[0][moves])))
    # as the vehicle starts near the first leg, both are counted from there
    heading = record.heading - 360.0 * round((record.heading[0] - course[0]) / 360.0)
    corners = moves[1:][np.abs(np.diff(course)) > 1.0]
    ends = [0, *corners, len(record.time_s)]
    for begin, end in zip(ends[:-1], ends[1:], strict=True):
        begin += round(CORNER_S / _SAMPLE_S)
        if end <= begin:
            continue
        middle = 0.5 * (begin + end)
        on = float(course[min(np.searchsorted(moves, middle), len(course) - 1)])
        leg = heading[begin:end]
        yield {
            'course_deg': on,
            'heading_spread_deg': float(np.ptp(leg)),
            'heading_off_course_deg': float(np.mean(leg)) - on,
        }


def measure_crab(record: Record, scenario: Scenario) -> dict[str, Any]:
    """Mean distance of the heading from the best crab angle against the current, steady."""
    steady, _ = _windows(record, scenario)
    speed, north, east = horizontal_speed(scenario), *scenario.constant_current()
    best, _, _ = crab_heading(scenario.path.course_rad(), speed, north, east)
    error = within_180(record.heading[steady] - math.degrees(best))
    return {'crab_error_deg': mean(np.abs(error))}


#: Measurements by their name in the file of experiments.
MEASURES = {
    'attitude': measure_attitude,
    'path': measure_path,
    'survey': measure_survey,
    'crab': measure_crab,
}
