"""Bags: rosbag2 folders with MCAP files, written and read without ROS running."""

from __future__ import annotations

from handover_dmp.recording.bag_reader import (
    bag_files,
    bag_information,
    BagInformation,
    BagMessage,
    read_bag,
)
from handover_dmp.recording.bag_writer import BagWriter
from handover_dmp.recording.message_definitions import message_definition, MessageDefinition
from handover_dmp.recording.qos import COMMAND, LATCHED, Qos, SENSOR
from handover_dmp.recording.repair import Repair, repair_bag

__all__ = [
    'COMMAND',
    'LATCHED',
    'SENSOR',
    'BagInformation',
    'BagMessage',
    'BagWriter',
    'MessageDefinition',
    'Qos',
    'Repair',
    'bag_files',
    'bag_information',
    'message_definition',
    'read_bag',
    'repair_bag',
]
