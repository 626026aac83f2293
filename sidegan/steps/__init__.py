"""The functions that ``sidegan`` exports and the stages call, one per step of the work with an arm.

They take a ``Cell``, plain values, NumPy arrays and files, and return NumPy arrays and data frames. Settings
are a dataclass or a mapping of its fields; missing fields have their defaults.
"""
