# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The vehicle in the water: its motion, its trim, and what its sensors tell."""
