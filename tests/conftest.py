"""Settings of all tests."""

from __future__ import annotations

from hypothesis import settings

# The first example of a test may compile a kernel, and a failure has to come back the next time.
settings.register_profile("boresight", deadline=None, derandomize=True)
settings.load_profile("boresight")
