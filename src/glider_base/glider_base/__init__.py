# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The vocabulary: kernels, settings, signals, frames, noise, equations, files and errors."""
