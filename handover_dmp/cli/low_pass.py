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

"""The option `--low-pass` of the verbs that smooth recordings."""

from __future__ import annotations

import argparse


def add_low_pass(parser: argparse.ArgumentParser, default: str = '6') -> None:
    """
    Declare `--low-pass`, which is parsed to a cutoff frequency in Hz, or None.

    Args:
        parser: parser of a verb.
        default: cutoff frequency, Hz, or `none`.

    """
    parser.add_argument(
        '--low-pass',
        type=_cutoff,
        default=default,
        metavar='HZ|none',
        help='cutoff frequency of the zero-phase low-pass filter of the recordings; none: no '
        'filter (default: %(default)s)',
    )


def _cutoff(text: str) -> float | None:
    if text.lower() == 'none':
        return None
    try:
        cutoff_hz = float(text)
    except ValueError:
        cutoff_hz = -1.0
    if not 0.0 < cutoff_hz < 1e5:
        raise argparse.ArgumentTypeError(f'{text!r} is neither a frequency above 0 Hz nor none')
    return cutoff_hz
