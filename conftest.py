# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What the tests of all packages have in common: pytest looks here from each of their folders."""

from hypothesis import settings

# an example may wait for a compiler, or for a processor that others use
settings.register_profile('glider', deadline=None)
settings.load_profile('glider')
