"""The experiments: one short module each, what a table shows and how it is aggregated."""
