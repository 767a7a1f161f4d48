# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What the vehicle estimates of itself: filters, gate, glide polar, learnt steering."""
