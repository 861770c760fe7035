"""One module per change of the tables, oldest first. A released one is never edited."""
