"""Access check of the view: requests are accepted from its own page only, under the host it is served at.

A page in a browser may connect to any port of the machine that the browser runs on, and viser does not check
the origin of a request. The header Origin names the page; the header Host names the server that the browser
addressed.
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

from outrider.view.page_document import TITLE_PATH, live_page, title_of

_ELSEWHERE = b"open this as localhost, by the address in numbers, or by the name that --host says\n"

Door = Callable[[ServerConnection, Request], Response | None]


def admits(host: str | None, origins: list[str], names: tuple[str, ...] = ("localhost",)) -> bool:
    """Return whether a request is accepted.

    The host must be an IP address or one of ``names``, so that no foreign name server has redirected the
    browser here. Every origin, if there is any, must be this server's own page.
    """
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


def _own(process: Door, connection: ServerConnection, request: Request, name: str) -> Response | None:
    """Return the answer of ``process``; the page itself with our changes."""
    path = request.path.partition("?")[0]
    if path == TITLE_PATH:
        text = title_of(name).encode()
        return Response(http.HTTPStatus.OK, "OK", _headers("text/plain; charset=utf-8", text), text)
    if path not in ("/", "/index.html"):
        return process(connection, request)
    if "Accept-Encoding" in request.headers:
        del request.headers["Accept-Encoding"]
    answer = process(connection, request)
    if answer is None or answer.status_code != http.HTTPStatus.OK:
        return answer
    body = live_page(answer.body.decode("utf-8"), name).encode()
    return Response(
        answer.status_code, answer.reason_phrase, _headers("text/html; charset=utf-8", body), body
    )


def _headers(kind: str, body: bytes) -> Headers:
    return Headers({"Content-Type": kind, "Content-Length": str(len(body)), "Cache-Control": "no-store"})


@contextmanager
def guarded(host: str, title: Callable[[], str] = lambda: "") -> Iterator[None]:
    """Restrict websocket servers started in this context, at ``host``, to requests that ``admits`` accepts.

    The page gets ``title()``, the name of the scene, and the changes of ``page_document``. The websocket
    servers have an option for that, which viser does not pass on.
    """
    serve: Any = served.serve
    names = ("localhost", host.lower())

    @wraps(serve)
    def guarding(*arguments: Any, process_request: Door, **options: Any) -> Any:
        def door(connection: ServerConnection, request: Request) -> Response | None:
            headers = request.headers
            hosts = headers.get_all("Host")
            if len(hosts) == 1 and admits(hosts[0], headers.get_all("Origin"), names):
                answer = _own(process_request, connection, request, title())
                if answer is not None:
                    # The page must not be shown in a frame of another page, where a click could be abused.
                    answer.headers["Content-Security-Policy"] = "frame-ancestors 'none'"
                return answer
            return Response(http.HTTPStatus.FORBIDDEN, "Forbidden", Headers(), _ELSEWHERE)

        return serve(*arguments, process_request=door, **options)

    served.serve = guarding  # type: ignore[misc,assignment]
    try:
        yield
    finally:
        served.serve = serve  # type: ignore[misc]
