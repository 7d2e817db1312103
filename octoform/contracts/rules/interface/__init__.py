"""Rules for the tools of INTERFACE: bounds, results, texts."""
