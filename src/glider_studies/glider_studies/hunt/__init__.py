# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Random faults in random missions, judged by the truth alone, shrunk to what does the harm."""
