"""How a device is described: its evidence, its names, what is claimed of it."""
