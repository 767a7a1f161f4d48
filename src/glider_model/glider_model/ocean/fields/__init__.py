# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Fields of current by place and time, one file each, called by the name of its file."""
