"""Campaigns: each case is computed by the reference and by the fast model, then scored; scores are averaged."""
