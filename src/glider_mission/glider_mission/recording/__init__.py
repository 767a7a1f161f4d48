# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings as files: one writer, one reader, and the order of what is recorded."""
