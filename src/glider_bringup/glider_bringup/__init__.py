# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Flying it: scenarios, engines, recorder, scores and the command line."""
