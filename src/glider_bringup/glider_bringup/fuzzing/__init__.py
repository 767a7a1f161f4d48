# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Hostile use, seeded and counted: one module for each door, each with ``fuzz(seed, count, tell)``."""
