# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Routes through a changing current: fronts of earliest arrival, and what a mission takes."""
