# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Imported where commands are forked (`command_line`): they need not load it again."""

import gc

from numba.core.registry import cpu_target

import glider_studies.workers  # noqa: F401  # Dask takes longest of all
from glider_bringup.warm_up import fly_one_tick, score_nothing

fly_one_tick()
score_nothing()
cpu_target.target_context.refresh()  # what some of them compile with
gc.freeze()  # a copy that looked for garbage in all that would copy it
