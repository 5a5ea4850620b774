"""Drawing of results: one table for terminal, page and file, and one tactile image."""
