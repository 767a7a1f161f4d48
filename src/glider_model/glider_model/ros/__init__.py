# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What every node shares: messages as numbers, parameters, quality of service, the tick."""
