"""Artifacts and what makes them: settings, store, tracking, command."""
