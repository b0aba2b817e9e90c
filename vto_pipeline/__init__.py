"""Virtual try-on: digitize garments, fit bodies, drape cloth, and say how good the result is."""

__version__ = "0.1.0"
