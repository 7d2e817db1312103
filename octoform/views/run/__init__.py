"""Runs: apply and destroy as they happen, attempts of agents, questions, programs that are installed."""
