"""The commands `derive`, `press` and `mesh` on sensors with curved covers."""
