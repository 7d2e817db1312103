"""Serving environments: resolved to a lockfile, built once, found whole, and what is imported in them."""
