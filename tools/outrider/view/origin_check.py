"""Who may speak to the view: its own page, in no other name than the place that it is served at.

Any page that a browser has open may connect to any port of the machine that the browser runs on, and viser
asks nobody where they come from. A page says in Origin who it is; the browser in Host for whom it takes us.
"""

from __future__ import annotations

import http
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from ipaddress import ip_address
from typing import Any
from urllib.parse import urlsplit

import websockets.asyncio.server as served
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

_ELSEWHERE = b"open this as localhost, by the address in numbers, or by the name that --host says\n"

Door = Callable[[ServerConnection, Request], Response | None]


def admits(host: str | None, origins: list[str], names: tuple[str, ...] = ("localhost",)) -> bool:
    """Whether a request is answered: to us by a number or by one of ``names``, so that nobody's name server
    has led the browser here, and from no page but our own, if from one at all."""
    if host is None:
        return False
    try:
        name = urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return False
    if name not in names:
        try:
            ip_address(name)
        except ValueError:
            return False
    return all(origin.lower() == f"http://{host.lower()}" for origin in origins)


@contextmanager
def guarded(host: str) -> Iterator[None]:
    """Servers of websockets that begin meanwhile, at ``host``, let in only whom ``admits`` allows. They have
    an option for that, which viser does not pass on."""
    serve: Any = served.serve
    names = ("localhost", host.lower())

    @wraps(serve)
    def guarding(*arguments: Any, process_request: Door, **options: Any) -> Any:
        def door(connection: ServerConnection, request: Request) -> Response | None:
            headers = request.headers
            hosts = headers.get_all("Host")
            if len(hosts) == 1 and admits(hosts[0], headers.get_all("Origin"), names):
                answer = process_request(connection, request)
                if answer is not None:
                    # Nor may its page stand in a frame of another, where a click is not meant for it.
                    answer.headers["Content-Security-Policy"] = "frame-ancestors 'none'"
                return answer
            return Response(http.HTTPStatus.FORBIDDEN, "Forbidden", Headers(), _ELSEWHERE)

        return serve(*arguments, process_request=door, **options)

    served.serve = guarding  # type: ignore[misc,assignment]
    try:
        yield
    finally:
        served.serve = serve  # type: ignore[misc]
