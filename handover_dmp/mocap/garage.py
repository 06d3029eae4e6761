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

"""The scenes of Prada et al. 2013: a garage with plausible positions and heights."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class GarageScene:
    """
    Positions of a configuration; x from the assistant to the mechanic, z up from the floor.

    Attributes:
        mechanic_at_work: wrist of P1 while working, m.
        mechanic_meets: wrist of P1 at the exchange, m.
        assistant_at_rest: wrist of P2 before it starts, m.
        tool: wrist of P2 where it picks up the tool, m.
        offset: wrist of P2 minus wrist of P1 at the exchange, m; the tool is between them.
        curve: deviation of the middle of P2's path from the straight line, m.
        duration_s: typical duration of P2's reach, s.

    """

    mechanic_at_work: tuple[float, float, float]
    mechanic_meets: tuple[float, float, float]
    assistant_at_rest: tuple[float, float, float]
    tool: tuple[float, float, float]
    offset: tuple[float, float, float]
    curve: tuple[float, float, float]
    duration_s: float


SCENES = {
    # The mechanic bends over the engine and reaches out sideways, about waist high.
    'engine_bay': GarageScene(
        mechanic_at_work=(0.72, 0.14, 0.84),
        mechanic_meets=(0.36, -0.02, 0.98),
        assistant_at_rest=(-0.40, -0.28, 0.86),
        tool=(-0.52, -0.62, 0.92),
        offset=(-0.27, -0.05, 0.03),
        curve=(0.00, -0.035, 0.040),
        duration_s=1.35,
    ),
    # The mechanic lies under the car, the hand comes out beside the sill; the assistant squats.
    'under_car': GarageScene(
        mechanic_at_work=(0.74, 0.12, 0.44),
        mechanic_meets=(0.37, 0.03, 0.32),
        assistant_at_rest=(-0.38, -0.20, 0.62),
        tool=(-0.62, -0.44, 0.34),
        offset=(-0.26, -0.03, 0.06),
        curve=(0.02, -0.020, 0.045),
        duration_s=1.55,
    ),
    # The mechanic works overhead under the lifted car and reaches down; the assistant stands.
    'hydraulic_lift': GarageScene(
        mechanic_at_work=(0.60, 0.06, 1.76),
        mechanic_meets=(0.34, -0.01, 1.36),
        assistant_at_rest=(-0.36, -0.24, 1.02),
        tool=(-0.50, -0.60, 0.90),
        offset=(-0.26, -0.04, -0.04),
        curve=(-0.02, -0.040, -0.020),
        duration_s=1.25,
    ),
}

CONFIGURATIONS = tuple(SCENES)
