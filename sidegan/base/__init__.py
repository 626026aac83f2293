"""Tools for all rooms: atomic files, typed settings, progress, parallel work."""
