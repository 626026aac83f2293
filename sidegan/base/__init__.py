"""What every room may use: atomic files, typed settings, progress, parallel work."""
