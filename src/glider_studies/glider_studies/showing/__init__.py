# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Pictures of studies: the paper's figures, and the map of a sweep."""
