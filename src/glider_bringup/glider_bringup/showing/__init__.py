# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What a person is shown of runs: reports, comparisons, pictures, scorecards."""
