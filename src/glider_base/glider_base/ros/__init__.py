# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What every node shares: parameters, the bytes of its topics, and how it keeps step."""
