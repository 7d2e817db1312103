"""What may be called, within which limits, and what of it is used up."""
