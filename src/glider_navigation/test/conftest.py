# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What the truth is made of: attitudes by scipy, steady glides by their balance of forces."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation


def _quaternions(phi, theta, psi):
    """q_NB (w, x, y, z) of angles (rad), one row each."""
    euler = np.stack(np.broadcast_arrays(psi, theta, phi), axis=-1)
    return np.roll(Rotation.from_euler('ZYX', euler).as_quat(), 1, axis=-1)


def _steady_speed(theta, rate, polar):
    """Horizontal speed (m/s) at which lift and drag have no horizontal part."""

    def across(alpha):
        drag = polar.K_D0 + polar.K_D * alpha**2
        lift = polar.K_L0 + polar.K_L * alpha
        return drag * math.cos(theta - alpha) + lift * math.sin(theta - alpha)

    alpha = brentq(across, 0.0, -math.copysign(math.radians(15.0), theta), xtol=1e-14)
    return rate / -math.tan(theta - alpha)


@pytest.fixture(scope='session')
def quaternions():
    """``quaternions(phi, theta, psi)``: q_NB (w, x, y, z), one row each."""
    return _quaternions


@pytest.fixture(scope='session')
def steady_speed():
    """``steady_speed(theta, rate, polar)``: horizontal speed (m/s) of a steady glide."""
    return _steady_speed
