"""The arm: its model and limits, priority inverse kinematics, interpolation, simulation."""
