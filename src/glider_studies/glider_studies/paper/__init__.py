# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The paper's experiments and what goes beyond them: limits, measures, verdicts."""
