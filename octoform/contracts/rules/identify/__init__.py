"""What IDENTIFY may say of a device: names, answers, capabilities."""
