# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What real gliders took out of their batteries."""
