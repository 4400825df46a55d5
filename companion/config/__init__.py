"""Settings of a companion: frozen, checked at load, passed explicitly. SI units, fleet-local ENU, µs.

A module for each part, aggregated by ``CompanionConfig``. Defaults are the paper's where it states a number.
"""

from companion.config.companion import CompanionConfig

__all__ = ["CompanionConfig"]
