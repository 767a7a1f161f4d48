# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The world: vehicle, actuators, water and the six-degree-of-freedom plant."""
