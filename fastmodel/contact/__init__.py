"""Contact methods, which compute forces on texels from contact forces in MuJoCo."""
