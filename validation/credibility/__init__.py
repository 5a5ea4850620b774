"""Evidence after ASME V&V 10 and V&V 20: code and solution verification, input uncertainty, range of validation."""
