"""The file: its bytes, its YAML as a tree in which every value knows its place, and what is reported with places."""
