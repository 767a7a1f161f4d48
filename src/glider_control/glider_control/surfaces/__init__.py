# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""How steering surfaces are steered by: one file each, called like that of the surface."""
