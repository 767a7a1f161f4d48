# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The command line: a file for each command, called like it."""
