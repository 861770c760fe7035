"""The store: what changes lives in a database, what does not in immutable files named by their own SHA-256."""
