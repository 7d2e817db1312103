"""Repairs: one small module for each kind, and the port through which the loop carries them out."""
