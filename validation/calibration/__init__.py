"""Determines from recordings under known loads how a real sensor turns force into counts."""
