# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What became of it: true motion, traces, and the score."""
