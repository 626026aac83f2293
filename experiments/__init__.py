"""The experiments: a short module each, with the tables' contents and their aggregation."""
