"""A run's page for the browser of this machine, which follows the run while it goes on.

Nothing but the page and its map is ever given out, to this machine alone: no path leads to a file
but to those of a page in tiles, and a name that another site made point to this machine is refused.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

from mcpseg_cli.choices import ColourBy
from mcpseg_cli.errors import McpsegError
from mcpseg_cli.export.html import map_bytes, page_text
from mcpseg_cli.export.page_map import PageMap, gather_map
from mcpseg_cli.export.selection import Selection
from mcpseg_cli.export.tiled_page import PageFolder
from mcpseg_cli.segment.labelled_run import LabelledRun

_HOST = "127.0.0.1"
_STATE = ("state.sqlite", "state.sqlite-wal")
_HEADERS = {"Cache-Control": "no-store", "X-Content-Type-Options": "nosniff"}


class FollowedMap:
    """The map of a run as it is whenever it is asked for; read again only after it has changed.

    Args:
        folder: Folder of the run.
        colour_by: What colours say when the page opens.

    Raises:
        InputError: Not the folder of a run, or of one without any voxel yet.
        StateError: The checkpoint is damaged or of another version.
    """

    def __init__(self, folder: Path, colour_by: ColourBy = "class") -> None:
        self._folder, self._colour_by = folder, colour_by
        self._lock = threading.Lock()
        self._moment, self._map = self._read()

    @property
    def name(self) -> str:
        """What the page is called."""
        return self._folder.resolve().name

    def moment(self) -> str:
        """Name the state that the checkpoint is in, without reading it."""
        states = []
        for name in _STATE:
            try:
                status = (self._folder / name).stat()
            except FileNotFoundError:  # the log of a run that has ended
                states.append("-")
            else:
                states.append(f"{status.st_size:x}.{status.st_mtime_ns:x}")
        return "_".join(states)

    def current(self) -> tuple[str, PageMap]:
        """Return the map and the moment it is of.

        Raises:
            McpsegError: The run has gone or is damaged.
        """
        with self._lock:
            if self.moment() != self._moment:
                self._moment, self._map = self._read()
            return self._moment, self._map

    def answer(self, path: str) -> tuple[str, bytes]:
        """Return the page, the moment that the run is at, or its map, by the path of a URL.

        Raises:
            LookupError: There is nothing else.
            McpsegError: The run has gone or is damaged.
        """
        if path == "/moment":
            return "text/plain", self.moment().encode("ascii")
        if path == "/":
            moment, page_map = self.current()
            return "text/html", page_text(self.name, page_map, moment).encode("utf-8")
        if path == "/map":
            moment, page_map = self.current()
            return "application/octet-stream", map_bytes(page_map, moment)
        raise LookupError(path)

    def _read(self) -> tuple[str, PageMap]:
        # a change in between is found again later
        moment = self.moment()
        with LabelledRun(self._folder) as run:
            return moment, gather_map(run, Selection(), self._colour_by)


@contextmanager
def serving(served: FollowedMap | PageFolder) -> Iterator[ThreadingHTTPServer]:
    """Open a server on a free port of this machine alone.

    Args:
        served: What is given out.

    Yields:
        The server: ``url_of`` says where, ``serve_forever`` answers until it is shut down.
    """
    server = ThreadingHTTPServer((_HOST, 0), _handler_of(served))
    server.daemon_threads = True
    try:
        yield server
    finally:
        server.server_close()


def url_of(server: ThreadingHTTPServer) -> str:
    """Return where a server answers."""
    return f"http://{_HOST}:{server.server_port}/"


def _handler_of(served: FollowedMap | PageFolder) -> type[BaseHTTPRequestHandler]:
    """Make the class that answers: the paths that ``served`` knows, nothing else."""

    class Handler(BaseHTTPRequestHandler):
        """Answers one request."""

        def do_GET(self) -> None:
            """Give what is at the path."""
            if not self._is_asked_by_name():
                self.send_error(HTTPStatus.FORBIDDEN, "not the name of this server")
                return
            try:
                kind, body = served.answer(self.path)
            except McpsegError as error:
                self.send_error(HTTPStatus.SERVICE_UNAVAILABLE, "the run", str(error))
            except LookupError:
                self.send_error(HTTPStatus.NOT_FOUND)
            else:
                self._send(kind, body)

        def _is_asked_by_name(self) -> bool:
            """Tell whether the request is meant for this server, not for one renamed to it."""
            port = self.connection.getsockname()[1]
            return self.headers.get_all("Host") in ([f"{_HOST}:{port}"], [f"localhost:{port}"])

        def _send(self, kind: str, body: bytes) -> None:
            self.send_response(HTTPStatus.OK)
            self.send_header("Content-Type", f"{kind}; charset=utf-8")
            self.send_header("Content-Length", str(len(body)))
            for name, value in _HEADERS.items():
                self.send_header(name, value)
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, format: str, *args: object) -> None:  # noqa: A002
            """Say nothing of each request."""

    return Handler
