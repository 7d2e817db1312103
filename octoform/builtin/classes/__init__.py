"""One module for each class of device: how it is recognised, and which tools it has."""
