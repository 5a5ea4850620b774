"""Cases, recordings, scores, reports and the command line."""
