# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Line of sight: from path-frame errors to the direction to fly, and to the heading for it.

Equation numbers are those of Zhang et al. (2021); docs/paper.md says where they are corrected.
"""

import math

from glider_base.frames import wrap_angle
from glider_base.kernel import kernel

#: How fast the path is approached from afar at most, in a current from behind; and in any case.
#: Times the speed through the water (-).
FASTEST_APPROACH, SLOWEST_APPROACH = 0.9, 0.3


@kernel
def approach_angles(e2, e3, delta_1, delta_2):
    """Approach angles gamma_r, rho_r (rad) toward the path, equations (8) and (9).

    Parameters
    ----------
    e2, e3 : float
        Cross-track error (m, + starboard) and normal error (m, + below).
    delta_1 : float
        Lookahead distance (m).
    delta_2 : float
        Ratio of the vertical lookahead to the distance sqrt(e2^2 + delta_1^2) (-).
    """
    gamma_r = -math.atan(e2 / delta_1)
    rho_r = math.atan(e3 / (delta_2 * math.sqrt(e2 * e2 + delta_1 * delta_1)))
    return gamma_r, rho_r


@kernel
def desired_direction(gamma_d, rho_d, gamma_r, rho_r):
    """Course chi_d and elevation upsilon_d (rad) of the approach, equation (10).

    The approach direction [c(rho_r) c(gamma_r), c(rho_r) s(gamma_r), -s(rho_r)] of the path frame,
    turned into NED by Q(gamma_d, rho_d). Elevation is positive upwards.
    """
    sgd, cgd = math.sin(gamma_d), math.cos(gamma_d)
    srd, crd = math.sin(rho_d), math.cos(rho_d)
    sgr, cgr = math.sin(gamma_r), math.cos(gamma_r)
    srr, crr = math.sin(rho_r), math.cos(rho_r)
    north = -sgd * sgr * crr - srd * srr * cgd + cgd * cgr * crd * crr
    east = cgd * sgr * crr - srd * srr * sgd + sgd * cgr * crd * crr
    up = srd * cgr * crr + crd * srr
    return math.atan2(east, north), math.asin(min(1.0, max(-1.0, up)))


@kernel
def target_rate(progress, e1, slope, delta, rate_max):
    """Rate s' (1/s of the path parameter) of the virtual target, equation (7), bounded.

    Parameters
    ----------
    progress : float
        Speed over ground along the path (m/s).
    e1 : float
        Along-track error (m); ``delta`` (1/s) takes it to zero.
    slope : float
        Length of dp_d/ds (-).
    """
    return min(rate_max, max(0.0, (progress + delta * e1) / slope))


@kernel
def crab_heading(course, speed, current_n, current_e):
    """Heading through the water that makes good a course over ground, and whether one exists.

    Equation (11) with the current: psi = chi_d - asin(sat(n . v_c / U_h)), where n points to
    starboard of the course.

    Parameters
    ----------
    course : float
        Desired course over ground chi_d (rad).
    speed : float
        Horizontal speed through the water U_h (m/s).
    current_n, current_e : float
        Water velocity (m/s).

    Returns
    -------
    heading : float
        Heading of the water track (rad); the best crab when the course is infeasible.
    progress : float
        Speed made good along the course with that heading (m/s).
    feasible : bool
        The cross current can be balanced and the progress is positive.
    """
    sine, cosine = math.sin(course), math.cos(course)
    across = -sine * current_n + cosine * current_e
    along = cosine * current_n + sine * current_e
    ratio = across / max(speed, 1e-3)
    held = min(1.0, max(-1.0, ratio))
    crab = math.asin(held)
    progress = speed * math.cos(crab) + along
    return wrap_angle(course - crab), progress, abs(ratio) <= 1.0 and progress > 0.0


@kernel
def approach_heading(course, approach, progress, speed, current_n, current_e):
    """Heading through the water that closes in on a path while the current is balanced.

    The vehicle is to move across the path at ``progress * sin(approach)``, which is what flying
    the course ``course + approach`` means near the path. A course over ground is the wrong thing
    to ask for far from it: where the current is faster than the vehicle, no heading makes good a
    course across it, and the best crab for one would let the vehicle drift away.

        psi = gamma_d - asin(sat((n . v_c - w) / U_h))

    with w = P sin(approach), near the path. A following current may be faster than the vehicle,
    which then comes to the path square to it and cannot turn in time. So w goes to V and no more,
    V = 0.9 U_h, more or less the current across and 0.3 U_h at least:
    w = P s / sqrt(c^2 + (P s / V)^2).

    Parameters
    ----------
    course : float
        Course of the path gamma_d (rad).
    approach : float
        Angle of the line of sight from it (rad, + to starboard).
    progress : float
        Speed made good along the path P (m/s).
    speed : float
        Horizontal speed through the water U_h (m/s).
    current_n, current_e : float
        Water velocity (m/s).
    """
    across = -math.sin(course) * current_n + math.cos(course) * current_e
    moves = max(speed, 1e-3)
    wanted = max(0.0, progress) * math.sin(approach)
    most = FASTEST_APPROACH * moves + math.copysign(across, wanted * across)
    most = max(SLOWEST_APPROACH * moves, most)
    if progress > most:
        wanted /= math.hypot(math.cos(approach), wanted / most)
    ratio = (across - wanted) / moves
    return wrap_angle(course - math.asin(min(1.0, max(-1.0, ratio))))
