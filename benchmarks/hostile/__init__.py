"""What holds under bad inputs, at large sizes and after a kill: one row each, beside its goal."""
