# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Commands about recordings: flown again by today's code, published again, made whole."""
