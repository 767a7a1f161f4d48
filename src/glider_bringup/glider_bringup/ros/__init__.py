# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What of a run's folder depends on ROS 2: definitions, type hashes, quality of service."""
