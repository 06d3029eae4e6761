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

"""`handover_dmp plot`: figures and report of a run, or a figure of a recorded session."""

from __future__ import annotations

import argparse

from handover_dmp.cli.options import add_json, save_json
from handover_dmp.cli.recorded import add_source_and_output

DPI = 120


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of `plot`.

    Args:
        parser: parser of the verb.

    """
    add_source_and_output(
        parser,
        'DIR',
        'folder for report and figures (default: the folder of the run, or <bag>_report)',
    )
    parser.description = (
        'Draw a recorded run and write its report. For a CSV file of both wrists, as `synthesize '
        '--sessions` writes, draw the whole session into DIR/session.png.'
    )
    add_json(parser, 'also write the numbers as JSON')


def run(options: argparse.Namespace) -> int:
    """
    Draw a run and write its report.

    Args:
        options: the parsed arguments.

    Returns:
        0.

    Raises:
        DataError: the bag does not exist, or is not of a run.

    """
    if options.source.suffix.lower() == '.csv':
        return _draw_recording(options)
    from handover_dmp.cli.progress import progress_bar
    from handover_dmp.report import write_report
    from handover_dmp.report.report import report_folder
    from rich.console import Console

    with progress_bar() as bar:
        bar.add_task('reading and drawing', total=None)
        report = write_report(options.source, options.output, options.namespace)
    folder = options.output or report_folder(options.source)
    Console().print(f'{len(report["figures"])} figures; {folder / "index.html"}', soft_wrap=True)
    save_json(report, options.json)
    return 0


def _draw_recording(options: argparse.Namespace) -> int:
    from dataclasses import asdict

    from handover_dmp.common.files import replacing
    from handover_dmp.mocap.fluency import people_fluency
    from handover_dmp.mocap.session import read_session
    from handover_dmp.mocap.session_figure import draw_session
    from rich.console import Console

    session = read_session(options.source)
    folder = options.output or options.source.with_name(f'{options.source.stem}_report')
    folder.mkdir(parents=True, exist_ok=True)
    picture = folder / 'session.png'
    with replacing(picture) as temporary:
        draw_session(session).savefig(temporary, dpi=DPI)
    Console().print(f'{len(session.exchanges)} exchanges; {picture}', soft_wrap=True)
    if options.json is not None:
        found = {
            'figure': str(picture),
            'exchanges': [part._asdict() for part in session.exchanges],
            'fluency': asdict(people_fluency(session)),
        }
        save_json(found, options.json)
    return 0
