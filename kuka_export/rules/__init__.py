"""The rules of `echobase check`, one module per kind. Each yields findings; none of them knows the writer."""
