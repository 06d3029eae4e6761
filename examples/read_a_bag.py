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

"""Read a recorded run, message by message and as arrays: python examples/read_a_bag.py RUN."""

from __future__ import annotations

from pathlib import Path
import sys

from handover_dmp.recording import read_bag
from handover_dmp.report import load_run
from handover_dmp.topics import STATE, WRIST_POSE
import numpy as np


def main(path: Path) -> None:
    """Print the states of the handover and the wrist's maximum speed in each."""
    count = 0
    for topic, message, log_ns in read_bag(path, [STATE.name, WRIST_POSE.name]):
        if topic == STATE.name:
            print(f'{log_ns / 1e9:8.3f} s  {message.data}')
        else:
            count += 1
    print(f'{count} wrist poses')

    run = load_run(path)
    times, positions = run.wrist_times, run.wrist_positions
    speeds = np.linalg.norm(np.gradient(positions, times, axis=0), axis=1)
    ends = [time_s for time_s, _ in run.states[1:]] + [run.end_time_s]
    for (begin, name), end in zip(run.states, ends, strict=True):
        within = (times >= begin) & (times <= end)
        if within.any():
            print(f'{name:<10} {end - begin:6.3f} s, at most {speeds[within].max():.3f} m/s')


if __name__ == '__main__':
    main(Path(sys.argv[1]))
