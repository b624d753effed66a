"""What a notebook shows: results as tables, and how far a call has come."""
