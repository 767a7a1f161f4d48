# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What is flown, and the record of it: scenarios, the blocks of a tick, recordings."""
