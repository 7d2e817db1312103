"""The command line: arguments to a typed request, one call of the engine, one view, one exit code."""
