"""A page on which an arm moves along trajectories: ``page.py``, its template and its scripts."""
