# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What a vehicle is: its file, rigid body, hydrodynamics and actuators."""
