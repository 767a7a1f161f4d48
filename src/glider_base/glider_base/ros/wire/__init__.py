# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Topics and their bytes: names, types, layout, codec and quality of service."""
