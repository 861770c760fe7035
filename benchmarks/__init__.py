"""The ratios EchoBase publishes, measured in one run on one machine: `make bench`."""
