"""The five ROS 2 nodes: each parameters, topics, timers and one object of the other rooms."""

from handover_dmp.threads import use_one_thread

use_one_thread()
