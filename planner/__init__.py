"""Nouns, frames, units, errors and path geometry: what every other package of EchoBase is written in."""
