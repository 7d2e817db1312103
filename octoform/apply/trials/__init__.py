"""A privileged step tried on the hardware: by reading back, and by camera."""
