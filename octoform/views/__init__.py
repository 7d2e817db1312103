"""Views: the only place that prints. One module for each noun, with a human and a JSON form."""
