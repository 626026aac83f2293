"""Thousands of valid, diverse, exciting trajectories for robot dynamics identification."""

__version__ = "0.2.0"
