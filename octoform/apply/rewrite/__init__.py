"""A rewritten server held against the accepted one, served for its proof, and put into its place."""
