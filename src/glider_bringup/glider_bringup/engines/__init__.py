# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""How it is flown: the direct engine, node processes, launch plan and live view."""
