# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Pictures of recorded flights of real gliders beside what the plant made of them."""
