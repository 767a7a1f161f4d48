# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What breaks in a vehicle, and when: faults as part of a scenario."""
