"""Optimisation: problem, penalties, objectives, information, search, and the choice of sets."""
