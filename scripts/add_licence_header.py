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

"""
Adds the licence header to every Python file of the repository that has none.

With `--check` it only lists those files, and exits with 1 if there are any.
"""

from __future__ import annotations

import argparse
from pathlib import Path
import re
import sys

HEADER = """\
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
"""
FOLDERS = ('examples', 'handover_dmp', 'launch', 'scripts', 'test')
# Any year and any holder are accepted; the licence text must follow.
PRESENT = re.compile(
    r'(#!.*\n)?# Copyright \d{4}(-\d{4})? \S.*\n' + re.escape(HEADER.split('\n', 1)[1])
)


def python_files(root: Path) -> list[Path]:
    """List the Python files that need a header; `setup.py` does not, by ament_copyright."""
    return [file for folder in FOLDERS for file in sorted((root / folder).rglob('*.py'))]


def with_header(text: str) -> str:
    """Return a file's text with the header above it, below a `#!` line if there is one."""
    if PRESENT.match(text):
        return text
    first, rest = re.match(r'(#![^\n]*\n)?(.*)', text, re.DOTALL).groups(default='')
    return first + HEADER + ('\n' + rest.lstrip('\n') if rest.strip() else '')


def main() -> int:
    """Add the headers, or check them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        '--check', action='store_true', help='list the files without changing them'
    )
    parser.add_argument(
        'files', nargs='*', type=Path, help='files to check (default: the whole repository)'
    )
    options = parser.parse_args()
    root = Path(__file__).resolve().parents[1]
    missing = [
        (file, new)
        for file in options.files or python_files(root)
        if (new := with_header(old := file.read_text(encoding='utf-8'))) != old
    ]
    for file, new in missing:
        print(f'{file}: no licence header' if options.check else f'{file}: header added')
        if not options.check:
            file.write_text(new, encoding='utf-8')
    return int(options.check and bool(missing))


if __name__ == '__main__':
    sys.exit(main())
