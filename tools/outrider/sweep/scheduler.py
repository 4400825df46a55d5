"""Address of a Dask scheduler, and the client connected to it."""

from __future__ import annotations

import logging
import re
import warnings
from threading import Thread
from typing import Any

from outrider.errors import InputError
from outrider.sweep.sources import version_of

CONNECT_S = 5.0
_ADDRESS = re.compile(r"(?:(?:tcp|tls)://)?(?:\[[0-9A-Fa-f:.%]+\]|[^\s/:\[\]]+):(?P<port>\d{1,5})")


def connected(address: str) -> Any:
    """Return a `distributed.Client` of the scheduler at ``address``.

    Raises InputError if the address is malformed, TLS is not set up here, no scheduler answers, or the
    scheduler has another version of Dask.
    """
    found = _ADDRESS.fullmatch(address)
    if found is None or not 0 < int(found["port"]) < 65536:
        raise InputError(
            f"--scheduler {address}: is no address; allowed: tcp://HOST:PORT, or tls://HOST:PORT"
        )
    if address.startswith("tls:") and not _has_tls():
        raise InputError(
            f"--scheduler {address}: there are no certificates for TLS here; allowed: Dask's own settings "
            "distributed.comm.tls.ca-file, .client.cert and .client.key, all three "
            "(DASK_DISTRIBUTED__COMM__TLS__CA_FILE and so on)"
        )
    ended: list[Any] = []
    # In a thread, because Dask waits without limit for the first message of a server with another protocol.
    thread = Thread(target=_connect, args=(address, ended), daemon=True)
    thread.start()
    thread.join(2 * CONNECT_S)
    if ended and not isinstance(ended[0], Exception):
        return ended[0]
    if ended and isinstance(ended[0], InputError):
        raise ended[0]
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


def _check_version(client: Any, address: str) -> None:
    """Raise InputError if the scheduler's version of Dask differs from the one here."""
    there = client.sync(client.scheduler.versions, callback_timeout=CONNECT_S)
    theirs, ours = there["packages"]["distributed"], version_of("distributed")
    if theirs != ours:
        raise InputError(
            f"--scheduler {address}: has distributed {theirs} (here {ours}); allowed: the same there and here"
        )


def _has_tls() -> bool:
    from distributed.security import Security

    try:
        settings = Security().get_connection_args("client")  # type: ignore[no-untyped-call]
    except OSError as error:
        # The file does not exist, or is not a certificate.
        raise InputError(
            f"--scheduler: the files of Dask's settings distributed.comm.tls cannot be used: {error}"
        ) from None
    return settings["ssl_context"] is not None


def _connect(address: str, ended: list[Any]) -> None:
    """Append to ``ended`` the client, or the exception that was raised."""
    from distributed import Client
    from distributed.versions import VersionMismatchWarning

    # The sweep itself reports connections that come and go.
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    # The versions of a worker are checked when it joins.
    warnings.simplefilter("ignore", VersionMismatchWarning)
    try:
        client = Client(  # type: ignore[no-untyped-call]
            address, timeout=CONNECT_S, set_as_default=False, name="outrider-sweep"
        )
    except Exception as error:
        # Any exception: the server may speak any protocol.
        ended.append(error)
        return
    try:
        _check_version(client, address)
    except Exception as error:
        client.close()  # type: ignore[no-untyped-call]
        ended.append(error)
    else:
        ended.append(client)
