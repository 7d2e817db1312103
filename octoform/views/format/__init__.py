"""The output of all views: the console, problems, tables, streams, and how values are written."""
