"""The emergency stop: its latch and its actions."""
