# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The guard: it watches sensors, actuators and depth, and has the last word on the command."""
