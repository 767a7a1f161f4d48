# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Ways to navigate that come with the stack: one file each, called by the name of its file."""
