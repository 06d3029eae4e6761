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

"""The ROS 2 nodes: parameters, topics and timers around objects of the other rooms."""

import os
import signal
import sys

from handover_dmp.common.threads import use_one_thread

use_one_thread()

# While `python -m handover_dmp.nodes.NAME` still loads libraries there is nothing to clean up,
# and Python would answer Ctrl-C with a traceback. `spin.run` takes over from here.
if sys.argv[:1] == ['-m']:
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda _caught, _frame: os._exit(0))
