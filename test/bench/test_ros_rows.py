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

"""What the benchmark of the graph makes of a run, for one of which all is known."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

pytestmark = pytest.mark.ros


def test_the_shares_in_motion_are_those_of_the_measured_periods() -> None:
    # here, since they need ROS
    from handover_dmp.bench.graph_run import WallClockRun
    from handover_dmp.bench.ros import _motion

    times_s = np.arange(0.0, 4.0, 0.005)
    on, moves = times_s < 3.0, times_s < 2.0
    run = WallClockRun(
        hand=np.column_stack((times_s, times_s)),
        dmp=np.column_stack((times_s, times_s, on)),
        ik=np.column_stack((times_s, times_s)),
        joints=np.column_stack((times_s, times_s, moves)),
        ticks={},
        probes={},
        handovers=1,
        span=(0.9975, 3.4975),
    )
    assert [row.value for row in _motion(run)] == pytest.approx([80.0, 40.0])
