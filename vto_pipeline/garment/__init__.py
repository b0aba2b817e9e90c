"""From a scanned surface to a garment: alignment, subtraction, openings, simulation mesh."""
