"""Recordings of runs: what they may say, and the folder that they are written to."""
