"""Simulated devices for who has none: servo bus, line protocol, camera. Beside the product; used by none of it."""
