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

"""Work that a handover needs once, done in advance: tables of the movement, imports."""

from __future__ import annotations

from handover_dmp.dmp import DecoupledDmp
from handover_dmp.handover.controller import HandoverController, HandoverOptions

PERIOD_S = 0.005


def rehearse(model: DecoupledDmp, options: HandoverOptions) -> None:
    """
    Run the beginning of an unpublished handover, so that the first real period is not slower.

    Otherwise it takes ten times as long as permitted, and the arm brakes for lack of commands.

    Args:
        model: the movement that will be run; it caches its tables.
        options: the rules.

    """
    controller = HandoverController(model, options)
    controller.set_wrist(model.start.tolist())
    controller.set_hand(0.0, (model.goal - model.goal_offset).tolist(), 0.0, 0.0)
    controller.start()
    for period in range(2):
        controller.step(period * PERIOD_S, PERIOD_S)
