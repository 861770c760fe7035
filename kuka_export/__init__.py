"""KRL: program model, preflight, writer, and a reader of its own that proves every exported program."""
