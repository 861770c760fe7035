"""Parts that sprang back, against analytic surfaces and analytic fields."""
