# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Commands that fly or show many flights at once: a file for each study."""
