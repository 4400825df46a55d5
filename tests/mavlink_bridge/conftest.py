"""No deadline for examples: a machine under load must not fail a law."""

from hypothesis import settings

settings.register_profile("laws", deadline=None)
settings.load_profile("laws")
