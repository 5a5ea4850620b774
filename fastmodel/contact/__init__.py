"""Contact methods: how contact forces in MuJoCo become forces on texels."""
