"""The nouns: frozen dataclasses of arrays, checked once when made. No algorithms."""
