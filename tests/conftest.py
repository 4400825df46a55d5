"""Hypothesis for all tests: no deadline, because a machine under load must not fail a law; and in CI the same
examples every time, so that what lands does not depend on luck. Elsewhere it goes on searching."""

import os

from hypothesis import settings

settings.register_profile("laws", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "laws")
