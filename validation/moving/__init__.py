"""Moving cases: loads and places that change in time, scored through the signal chain of each model."""
