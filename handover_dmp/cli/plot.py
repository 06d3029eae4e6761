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

"""`handover_dmp plot`: the figures and the report of a recorded run, from its bag alone."""

from __future__ import annotations

import argparse
from pathlib import Path

from handover_dmp.cli.recorded import add_source_and_output


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Declare the words after `plot`.

    Args:
        parser: parser of the verb.

    """
    add_source_and_output(
        parser,
        'DIR',
        'where report and figures go; default: the folder of the run, or <bag>_report',
    )
    parser.add_argument('--json', type=Path, metavar='FILE', help='write the numbers there, too')


def run(options: argparse.Namespace) -> int:
    """
    Draw a run and write its report.

    Args:
        options: what `add_arguments` declared.

    Returns:
        0.

    Raises:
        DataError: there is no such bag, or it is not that of a run.

    """
    import json

    from handover_dmp.cli.progress import progress_bar
    from handover_dmp.common.files import write_text
    from handover_dmp.report import write_report
    from handover_dmp.report.report import report_folder
    from rich.console import Console

    with progress_bar() as bar:
        bar.add_task('reading and drawing', total=None)
        report = write_report(options.source, options.output, options.namespace)
    folder = options.output or report_folder(options.source)
    Console().print(f'{len(report["figures"])} figures; {folder / "index.html"}', soft_wrap=True)
    if options.json is not None:
        write_text(options.json, json.dumps(report, indent=2) + '\n')
    return 0
