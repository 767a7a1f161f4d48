# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Where the vehicle estimates it is: what its sensors say, and dead reckoning between fixes."""
