"""Models asked from Python: routes, keys, prices, one request, one bare completion."""
