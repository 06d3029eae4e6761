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

"""What a process has in shared memory."""

from __future__ import annotations

from pathlib import Path


def shared_memory_of(pid: int) -> set[Path]:
    """List the shared memory of a process for DDS; other programs of the machine have theirs."""
    mapped = [line.split()[-1] for line in Path(f'/proc/{pid}/maps').read_text().splitlines()]
    opened = [str(link.readlink()) for link in Path(f'/proc/{pid}/fd').iterdir()]
    return {Path(name) for name in mapped + opened if name.startswith('/dev/shm/fastrtps')}
