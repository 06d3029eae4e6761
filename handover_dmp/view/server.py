# Copyright 2026 The handover_dmp authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""A local server for one page, on this machine only."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

from handover_dmp.common.errors import UsageError

ADDRESS = '127.0.0.1'


class _Page(SimpleHTTPRequestHandler):
    """Serves the files of one folder without logging."""

    def log_message(self, *_words: Any) -> None:
        """Log nothing."""

    def list_directory(self, _path: Any) -> None:
        """Refuse directory listings."""
        self.send_error(404)


@contextmanager
def serving(page: Path, port: int = 0) -> Iterator[str]:
    """
    Serve a page on the loopback interface within a `with` block.

    Args:
        page: the HTML file; its folder should contain nothing else.
        port: TCP port; 0: any free port.

    Yields:
        Its address.

    Raises:
        UsageError: the port is taken.

    """
    handler = partial(_Page, directory=str(page.parent))
    try:
        server = ThreadingHTTPServer((ADDRESS, port), handler)
    except (OSError, OverflowError) as error:
        raise UsageError(f'port {port}: {error}') from error
    thread = Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f'http://{ADDRESS}:{server.server_port}/{page.name}'
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
