# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Whether tests notice: the kernels with one thing changed, and the tests run on each."""
