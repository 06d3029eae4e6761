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

"""Progress bars of the commands."""

from __future__ import annotations

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn


def progress_bar(*, hidden: bool = False) -> Progress:
    """
    Make a bar, which is shown on standard error while entered, and only on a terminal.

    Args:
        hidden: whether to show no bar, for work that is done before one could read it.

    Returns:
        The bar.

    """
    console = Console(stderr=True)
    return _Bar(
        TextColumn('{task.description:<22}'),
        BarColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=hidden or not console.is_terminal,
    )


class _Bar(Progress):
    """A bar that prints nothing if it was not shown: rich 13 ends it with an empty line."""

    def stop(self) -> None:
        if not self.disable:
            super().stop()
