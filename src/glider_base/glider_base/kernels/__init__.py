# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What is kept of compiled kernels, and how they are compiled."""
