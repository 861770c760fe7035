"""KRL: program model, preflight, writer per controller, and a reader that proves every exported program."""
