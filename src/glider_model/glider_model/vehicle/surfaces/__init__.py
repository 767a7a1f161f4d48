# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Steering surfaces that come with the stack: one file each, called like its section of a file."""
