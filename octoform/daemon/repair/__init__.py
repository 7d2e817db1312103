"""Repairs: one small module for each kind, the process of their own in which they are made, and the port to it."""
