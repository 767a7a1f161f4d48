# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Paths: the curve that is followed, and what a person writes."""
