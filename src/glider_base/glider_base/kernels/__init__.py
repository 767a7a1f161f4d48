# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""How kernels are compiled, what is kept of them, and how tuples of numbers come to them."""
