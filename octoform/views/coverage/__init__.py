"""Coverage: what of the hardware is usable, at a terminal, as JSON and as a page."""
