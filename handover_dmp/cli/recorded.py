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

"""Options of all verbs that read a recorded run."""

from __future__ import annotations

import argparse
from pathlib import Path


def add_source_and_output(
    parser: argparse.ArgumentParser, metavar: str, purpose: str, *, optional: bool = False
) -> None:
    """
    Declare the run, `--namespace` and `--output`.

    Args:
        parser: parser of the verb.
        metavar: metavar of the output, e.g. `DIR`.
        purpose: help text of the output.
        optional: whether the run may be left out.

    """
    parser.add_argument(
        'source',
        type=Path,
        nargs='?' if optional else None,
        metavar='RUN_OR_BAG',
        help='folder of a run, folder of a bag (rosbag2 as well), or MCAP file',
    )
    parser.add_argument(
        '--namespace', metavar='NAME', help='namespace of the graph, if the bag has several'
    )
    parser.add_argument('-o', '--output', type=Path, metavar=metavar, help=purpose)
