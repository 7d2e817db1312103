"""What INTERFACE may offer as a tool: bounds, results, texts."""
