# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What a Python program is given: flights, runs as datasets, sweeps and trims."""
