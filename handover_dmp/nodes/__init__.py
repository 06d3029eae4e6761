"""The five ROS 2 nodes: each parameters, topics, timers and one object of the other rooms."""
