"""The page of a run as an HTML file."""
