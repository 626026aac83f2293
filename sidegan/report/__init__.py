"""Tables and figures from artifacts."""
