"""Colours that figures and pages share."""

# Distinct on white and dark pages, and for colour-blind readers.
PALETTE = ("#1f77b4", "#d95f02", "#1b9e77", "#a6559d", "#b08a00", "#b2182b", "#7f7f7f", "#4d9221")
DESK = "#b59b7c"  # in pictures of motion
