# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Sweeps: their plan, their flights, their journal and their result."""
