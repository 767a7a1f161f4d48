# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Many flights, and what they say together."""
