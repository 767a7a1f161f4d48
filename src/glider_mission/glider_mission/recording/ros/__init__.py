# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What of a recording speaks ROS 2: the rosbag2 folder, what reads it, and publishing it again."""
