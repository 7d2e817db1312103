"""Stands for the modules beside a generated server."""
