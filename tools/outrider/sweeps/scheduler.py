"""A Dask scheduler's address, and the client that speaks with it."""

from __future__ import annotations

import logging
import re
import warnings
from threading import Thread
from typing import Any

from outrider.errors import InputError

CONNECT_S = 5.0
_ADDRESS = re.compile(r"(?:(?:tcp|tls)://)?(?:\[[0-9A-Fa-f:.%]+\]|[^\s/:\[\]]+):(?P<port>\d{1,5})")


def connected(address: str) -> Any:
    """A `distributed.Client` of the scheduler at ``address``. InputError if there is none."""
    found = _ADDRESS.fullmatch(address)
    if found is None or not 0 < int(found["port"]) < 65536:
        raise InputError(
            f"--scheduler {address}: is no address; allowed: tcp://HOST:PORT, or tls://HOST:PORT"
        )
    if address.startswith("tls:") and not _has_tls():
        raise InputError(
            f"--scheduler {address}: there are no certificates for TLS here; allowed: Dask's own settings, "
            "as DASK_DISTRIBUTED__COMM__TLS__CA_FILE"
        )
    ended: list[Any] = []
    # In a thread, as Dask waits for ever for a first word that is none of its protocol.
    thread = Thread(target=_connect, args=(address, ended), daemon=True)
    thread.start()
    thread.join(2 * CONNECT_S)
    if ended and not isinstance(ended[0], Exception):
        return ended[0]
    if ended and isinstance(ended[0], OSError):
        why = "nobody answers there"
    elif ended:
        why = (
            f"no Dask scheduler answers there ({type(ended[0]).__name__}: {' '.join(str(ended[0]).split())})"
        )
    else:
        why = "whoever answers there is no Dask scheduler"
    raise InputError(
        f"--scheduler {address}: {why}; allowed: the address that `dask scheduler` says when it starts"
    )


def _has_tls() -> bool:
    from distributed.security import Security

    return Security().get_connection_args("client")["ssl_context"] is not None  # type: ignore[no-untyped-call]


def _connect(address: str, ended: list[Any]) -> None:
    """Put into ``ended`` the client, or what it raised."""
    from distributed import Client
    from distributed.versions import VersionMismatchWarning

    # What Dask would say of connections that come and go the sweep says itself.
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    # Which versions a worker has is looked at when it comes.
    warnings.simplefilter("ignore", VersionMismatchWarning)
    try:
        client = Client(  # type: ignore[no-untyped-call]
            address, timeout=CONNECT_S, set_as_default=False, name="outrider-sweep"
        )
    except Exception as error:
        # Whatever it is that speaks there.
        ended.append(error)
    else:
        ended.append(client)
