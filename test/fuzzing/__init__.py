# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Hostile use, seeded and counted: a module for each door, with ``fuzz(seed, count, tell)``."""
