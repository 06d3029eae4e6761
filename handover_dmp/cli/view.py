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

"""`handover_dmp view`: a recorded run in the browser, with a time slider."""

from __future__ import annotations

import argparse
from pathlib import Path
import signal
from threading import Event

from handover_dmp.cli.options import add_json, save_json
from handover_dmp.cli.recorded import add_source_and_output
from handover_dmp.cli.robot_arguments import add_robot_arguments, chosen_arm


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of `view`.

    Args:
        parser: parser of the verb.

    """
    add_source_and_output(
        parser,
        'FILE.html',
        'write the page to this file, for any browser, and exit',
    )
    parser.add_argument(
        '--port', type=int, default=0, help='port on 127.0.0.1 (default: a free one)'
    )
    parser.add_argument('--no-browser', action='store_true', help='only print the address')
    add_robot_arguments(parser, '')
    add_json(parser, 'write the address as JSON')


def run(options: argparse.Namespace) -> int:
    """
    Make the page and serve it until Ctrl-C.

    Args:
        options: the parsed arguments.

    Returns:
        0.

    Raises:
        DataError: the run does not exist or cannot be drawn.
        UsageError: MeshCat is not installed, or the port is taken.

    """
    from tempfile import TemporaryDirectory
    import webbrowser

    from handover_dmp.cli.progress import progress_bar
    from handover_dmp.view.page import write_page
    from handover_dmp.view.server import serving
    from handover_dmp.view.stage import set_up
    from rich.console import Console

    def make(page: Path) -> None:
        with progress_bar() as bar:
            bar.add_task('reading and drawing', total=None)
            with set_up(options.source, chosen_arm(options), options.namespace) as stage:
                write_page(stage, page)

    def tell(address: str) -> None:
        save_json({'page': address}, options.json)

    if options.output is not None:
        make(options.output)
        tell(str(options.output))
        Console().print(str(options.output), soft_wrap=True)
        return 0
    with TemporaryDirectory() as folder:
        page = Path(folder) / 'handover.html'
        make(page)
        ended = _event_of_the_end()
        with serving(page, options.port) as address:
            tell(address)
            Console().print(f'{address}   (Ctrl-C ends)', soft_wrap=True)
            if not options.no_browser:
                webbrowser.open(address)
            ended.wait()
    return 0


def _event_of_the_end() -> Event:
    """Return an event that Ctrl-C or SIGTERM sets, even if the shell ignores them."""
    ended = Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda _number, _frame: ended.set())
    return ended
