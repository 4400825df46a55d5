"""A Dask scheduler's address, and the client that speaks with it."""

from __future__ import annotations

import re
import warnings
from typing import Any

import dask

from outrider.errors import InputError

CONNECT_S = 5.0
_ADDRESS = re.compile(
    r"(?:(?P<kind>tcp|tls)://)?(?P<host>\[[0-9A-Fa-f:.%]+\]|[^\s/:\[\]]+):(?P<port>\d{1,5})"
)
# What Dask would say of workers that come and go the sweep says itself. Read when distributed is imported.
dask.config.set({"logging.distributed": "critical", "logging.distributed.client": "critical"})


def connected(address: str) -> Any:
    """A `distributed.Client` of the scheduler at ``address``. InputError if there is none."""
    from distributed import Client
    from distributed.versions import VersionMismatchWarning

    found = _ADDRESS.fullmatch(address)
    if found is None or not 0 < int(found["port"]) < 65536:
        raise InputError(
            f"--scheduler {address}: is no address; allowed: tcp://HOST:PORT, or tls://HOST:PORT"
        )
    # Which worker has what is looked at when it comes.
    warnings.simplefilter("ignore", VersionMismatchWarning)
    try:
        return Client(  # type: ignore[no-untyped-call]
            address, timeout=CONNECT_S, set_as_default=False, name="outrider-sweep"
        )
    except OSError as error:
        why = "nobody answers there" if isinstance(error, TimeoutError) else " ".join(str(error).split())
    except Exception as error:
        # Something else may listen there, and whatever it says is no scheduler.
        why = f"no Dask scheduler answers there ({type(error).__name__}: {' '.join(str(error).split())})"
    raise InputError(
        f"--scheduler {address}: {why}; allowed: the address that `dask scheduler` prints when it starts"
    )
