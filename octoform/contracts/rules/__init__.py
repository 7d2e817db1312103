"""The cross-stage rules: what a schema cannot say, one module for each stage and kind."""
