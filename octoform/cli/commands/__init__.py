"""One module for each group of the table; each command has ``run_NAME(arguments, run)``."""
