"""What an agent may not touch while it runs."""
