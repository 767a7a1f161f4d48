# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Fixes that contradict navigation."""

from glider_base.kernel import kernel
from glider_guard.rows import ASTRAY, CONTRADICTED
from glider_model.onboard.fix_watch import contradictions

#: So many of the last six surfacings end the mission.
TOO_MANY = 2


@kernel
def fix_rows(watch):
    """Rows that hold by a `FixWatch`."""
    count = contradictions(watch)
    if count >= TOO_MANY:
        return CONTRADICTED | ASTRAY
    return CONTRADICTED if count > 0 else 0
