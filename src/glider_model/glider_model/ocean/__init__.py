# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The water around the vehicle: its velocity and its density."""
