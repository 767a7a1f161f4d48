# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Recorded flights of real gliders: their files, and navigation over them."""
