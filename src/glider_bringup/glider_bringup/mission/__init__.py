# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What is flown: scenarios, and the folder of a run."""
