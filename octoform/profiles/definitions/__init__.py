"""Protocol definitions: how a product is spoken to, as data, read with every problem of them in its place."""
