"""Adapters: Gymnasium environments, the Gazebo plugin block, and batches of worlds."""
