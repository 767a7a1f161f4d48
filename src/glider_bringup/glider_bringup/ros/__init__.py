# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What of a run speaks ROS 2: parameters of its nodes, its bag as a log, and verification."""
