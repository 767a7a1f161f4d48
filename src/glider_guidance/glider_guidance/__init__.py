# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Where to go: paths, line-of-sight laws, dive profile and current observer."""
