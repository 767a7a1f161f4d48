# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Validation: the plant flown the way a real glider was, and how far off it comes out."""
