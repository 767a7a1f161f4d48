# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""ROS nodes of this package: shells around its step functions."""

from glider_base.errors import leave_while_importing

leave_while_importing()
