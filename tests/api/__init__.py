"""Tests of the REST interface, its server and its safety."""
