"""The five ROS 2 nodes: each parameters, topics, timers and one object of the other rooms."""

import os
import signal
import sys

from handover_dmp.threads import use_one_thread

use_one_thread()

# While `python -m handover_dmp.nodes.NAME` still loads libraries there is nothing to end cleanly,
# and Python would answer Ctrl-C with a traceback. `spinning.run` takes over from here.
if sys.argv[:1] == ['-m']:
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda _caught, _frame: os._exit(0))
