"""A process that closes its socket to the ``Conductor``, and goes on until its standard input ends."""

from __future__ import annotations

import os
import sys

if __name__ == "__main__":
    os.close(int(sys.argv[1]))
    sys.stdin.read()
