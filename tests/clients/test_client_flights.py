"""Clients of other people, as they come from PyPI, each flying a vehicle of ``outrider sitl`` in real time: the
bars of discovery, health, telemetry, parameters, plans, flight.

All fly at the same time, since each waits most of the time.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import pytest
from client_rig import OURS, Client, Flight, python
from sitl_process import Sitl, free_port

pytestmark = pytest.mark.slow

FLAVOURS = ("px4", "ardupilot")
MAVSDK = {"mavsdk3": "mavsdk_grpc.py", "mavsdk4": "mavsdk_ctypes.py"}
