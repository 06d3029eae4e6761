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

"""A handover that was rehearsed begins without delay."""

from __future__ import annotations

from time import process_time

from handover_dmp.handover.controller import HandoverController, HandoverOptions, movement_for
from handover_dmp.handover.recordings import example_model
from handover_dmp.handover.rehearsal import rehearse


def test_what_is_made_once_is_made_before_the_first_period() -> None:
    """In processor time, so that a busy machine counts for nothing."""
    options = HandoverOptions()
    movement = movement_for(example_model(), options, stiffness=201.0)
    begun_s = process_time()
    rehearse(movement, options)
    rehearsed_s = process_time() - begun_s
    controller = HandoverController(movement, options)
    controller.set_wrist((0.0, 0.0, 1.0))
    controller.set_hand(0.0, (0.5, 0.1, 1.1), 0.0, 0.0)
    begun_s = process_time()
    assert controller.start()
    assert controller.step(0.0, 0.005) is not None
    assert process_time() - begun_s < 0.2 * rehearsed_s
