"""Views: the only place that prints. One module per command, each with a human and a JSON form."""
