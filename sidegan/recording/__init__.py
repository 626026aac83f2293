"""Recordings of a real arm: reading files, checking plausibility, filtering into segments.

Unusable recordings raise a RecordingError that names file, value and setting.
"""
