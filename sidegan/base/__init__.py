"""Tools of every room: atomic files, typed settings, progress, parallel work."""
