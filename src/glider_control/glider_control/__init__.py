# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""How to get there: motion control laws and their allocation to the three actuators."""
