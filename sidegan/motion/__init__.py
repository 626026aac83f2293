"""Trajectories and rigid-body dynamics."""
