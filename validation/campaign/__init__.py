"""Cases pressed by the reference and by the fast model, scored and pooled."""
