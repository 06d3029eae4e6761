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

"""Bags: rosbag2 folders with MCAP files, written and read without a running ROS."""

from __future__ import annotations

from handover_dmp.recording.bag_reader import bag_files, bag_information, BagMessage, read_bag
from handover_dmp.recording.bag_writer import BagWriter
from handover_dmp.recording.message_definitions import message_definition
from handover_dmp.recording.namespaces import recorded_namespace
from handover_dmp.recording.qos import LATCHED, Qos, SENSOR
from handover_dmp.recording.repair import repair_bag

__all__ = [
    'LATCHED',
    'SENSOR',
    'BagMessage',
    'BagWriter',
    'Qos',
    'bag_files',
    'bag_information',
    'message_definition',
    'read_bag',
    'recorded_namespace',
    'repair_bag',
]
