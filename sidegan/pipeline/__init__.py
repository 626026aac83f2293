"""Artifacts and their production: settings, stages, store, tracking, command."""
