# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""How nodes march in step: process, inputs, peers, watch, clock, and the reports between them."""
