# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Verification: what today's code makes of recorded inputs, against what is recorded."""
