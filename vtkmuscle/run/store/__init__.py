"""The folder of a run's results: what is in it, and whose it is."""
