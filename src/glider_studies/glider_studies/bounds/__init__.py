# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Bounds of the steering loop: what is certified of it, and flights beside that."""
