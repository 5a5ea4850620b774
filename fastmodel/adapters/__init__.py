"""Interfaces to other software: Gymnasium, Gazebo, and many worlds at once."""
