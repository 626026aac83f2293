"""The steps of the work with an arm, a function each: what stages call, and what ``sidegan`` has at its top.

They take a ``Cell``, plain values, NumPy arrays and files, and give NumPy arrays and data frames. Settings
are a dataclass or a mapping of its fields; what is left out has its default.
"""
