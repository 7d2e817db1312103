"""Simulated devices for those who have none: servo bus, line protocol, camera; beside the product, used by none of it."""
