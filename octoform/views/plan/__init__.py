"""The plan: its actions, reasons and symbols in words, the hardware and what is known of it."""
