"""Campaigns: cases pressed by the reference and by the fast model, their scores, and means over cases."""
