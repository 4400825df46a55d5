"""Streams of random numbers of a seed: one table, so that no two uses draw the same numbers.

A stream is numpy's default generator seeded with the words seed, tag and number. numpy pads missing words
with zeros, so the tag 0, of the starts' jitter, gives the stream of the bare seed; every other tag is larger.
``sitl`` uses a vehicle's system id, 10 or more, in the place of the tag.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np


class Stream(IntEnum):
    """Use of a stream."""

    STARTS = 0
    PHASES = 1
    CLOCKS = 2
    SCENE_TARGET = 3
    SCENE_OBSTACLES = 4
    SCENE_FLEET = 5
    SCENE_STARTS = 6
    SCENE_GOALS = 7
    SCENE_COUNTS = 8
    SCENE_TROUBLE = 9
    SYSTEM_CLOCKS = 10


def stream(seed: int, of: Stream, number: int = 0) -> np.random.Generator:
    """Return the generator of ``seed`` for one use, the ``number``th of its kind."""
    return np.random.default_rng([seed, of, number])
