"""What all views print with: the console, problems, tables, streams, and how values are written."""
