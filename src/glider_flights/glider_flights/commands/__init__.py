# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Commands over recorded flights of real gliders."""
