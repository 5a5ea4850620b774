"""Adapters of the fast model to Gymnasium environments, to Gazebo plugin blocks, and to batches of simulations."""
