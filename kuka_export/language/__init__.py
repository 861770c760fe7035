"""KRL read from its rules: lexer, expressions, statements. Knows nothing of the writer."""
