# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Where a vehicle is between two fixes."""

#: It has no need of fixes; under water; at the surface without a fix so far; with one.
KNOWN, UNDER_WATER, AT_SURFACE, FIXED = 0, 1, 2, 3
PHASE_NAMES = ('position known', 'under water', 'at the surface, no fix yet', 'fixed')
