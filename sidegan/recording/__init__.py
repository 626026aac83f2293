"""Recordings of a real arm, from files to filtered segments, and what is suspicious in them.

Whatever cannot be read or used is refused by a RecordingError, with file, value and setting.
"""
