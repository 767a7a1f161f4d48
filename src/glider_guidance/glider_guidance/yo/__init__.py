# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Dives: their stages, their turns, and how they end with a path."""
