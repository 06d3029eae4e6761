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

"""Errors that a user can act on: one clear line each, with an exit code."""

GET_ROS = "source a ROS 2 installation or run: pip install 'handover_dmp[ros]'"


class HandoverError(Exception):
    """
    Base of every error that this package raises on purpose.

    The message is one line that names what is wrong and where. The command line prints it without
    a traceback and exits with `exit_code`.
    """

    exit_code = 1


class DataError(HandoverError):
    """A file or a message cannot be used; names file, line and fault."""


class UsageError(HandoverError):
    """The request is invalid: unknown option, missing file name, wrong combination."""

    exit_code = 2
