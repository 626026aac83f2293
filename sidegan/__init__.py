"""Thousands of valid, diverse, exciting trajectories for robot dynamics identification."""

__version__ = "0.1.0"
