"""The whole loop against an analytic truth that shares nothing with EchoBase but the text of its files."""
