"""The tunnel to the endpoint, watched and ended."""
