"""Recordings of a real arm: read, checked, and preprocessed to segments for identification."""
