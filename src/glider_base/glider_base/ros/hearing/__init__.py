# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What a node hears: who publishes it, whose topic it is, and what came last."""
