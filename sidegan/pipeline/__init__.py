"""The graph of artifacts and what runs it: settings, store, tracking, command."""
