"""Trajectories and rigid-body dynamics, plain and compiled."""
