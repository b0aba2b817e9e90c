"""Files to model and back; the only place that touches formats and untrusted bytes."""
