"""A page that animates an arm along trajectories: ``page.py``, its template and scripts."""
