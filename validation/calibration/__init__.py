"""What a real sensor does with force, from recordings under known loads."""
