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

"""What a graph is told in which nodes are killed and stalled."""

from __future__ import annotations

from typing import Any


def prepare_for_faults(parameters: dict[str, dict[str, Any]], patience_s: float) -> None:
    """Let the hand come when it is told to, time pass as on a clock, nobody be waited for long."""
    parameters['hand_tracker']['replay_at_s'] = -1.0
    # as fast as it goes it would take both processors also where a test only waits
    parameters['robot_sim']['real_time_factor'] = 1.0
    # who is killed is not to be waited for as long as one that is merely slow
    for name in ('dmp', 'priority_ik'):
        parameters[name]['patience_s'] = patience_s
