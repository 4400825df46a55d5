"""Settings of a companion: takes a configuration, gives checked values in SI units, ENU and µs.

Settings are frozen, checked at load and passed explicitly; positions are fleet-local ENU. Each part has a
module, and ``CompanionConfig`` aggregates them. Defaults are the paper's where it states a number.
"""

from companion.config.companion import CompanionConfig

__all__ = ["CompanionConfig"]
